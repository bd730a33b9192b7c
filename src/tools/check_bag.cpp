// Says whether a bag can be played: kitti.launch asks before it starts anything.
// Usage: check_bag BAG [--topic TOPIC]...

#include <rosbag/view.h>

#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

#include "CommandLine.hpp"
#include "OpenBag.hpp"

namespace {

namespace po = boost::program_options;

constexpr const char* USAGE =
    R"(Usage: check_bag BAG [--topic TOPIC]...

Prints the name of the bag if it is complete and has messages of one of the topics at least.
)";

void check(const std::string& file, const std::vector<std::string>& topics) {
  // A node has another working directory.
  if (file.empty() || file[0] != '/')
    throw std::runtime_error("\"" + file + "\" is relative, expected a full path");
  rosbag::Bag bag;
  disparity_refinement::openBag(file, bag);
  rosbag::View view(bag, rosbag::TopicQuery(topics));
  if (topics.empty() || view.size() > 0) return;
  std::string names;
  for (const std::string& topic : topics) names += (names.empty() ? "" : ", ") + topic;
  throw std::runtime_error(file + " has no message, expected some on " + names +
                           "; bag_arguments finds the topics of a stereo pair");
}

}  // namespace

int main(int argc, char** argv) {
  return disparity_refinement::runTool("check_bag", [&] {
    po::options_description options("Options");
    options.add_options()("topic", po::value<std::vector<std::string>>()->composing(), "any number of times");
    po::variables_map values;
    if (!disparity_refinement::parseCommandLine(argc, argv, USAGE, {"BAG"}, options, values)) return;
    const auto file = values["BAG"].as<std::string>();
    check(file, values.count("topic") > 0 ? values["topic"].as<std::vector<std::string>>()
                                          : std::vector<std::string>());
    std::puts(file.c_str());
  });
}
