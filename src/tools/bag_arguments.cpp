#include <cstdio>

#include "BagArguments.hpp"
#include "CommandLine.hpp"

namespace {

constexpr const char* USAGE =
    R"(Usage: bag_arguments BAG

Finds the rectified stereo pair of a bag and prints the arguments with which kitti.launch
plays it, one a line.
)";

}  // namespace

int main(int argc, char** argv) {
  return disparity_refinement::runTool("bag_arguments", [&] {
    boost::program_options::variables_map values;
    if (!disparity_refinement::parseCommandLine(argc, argv, USAGE, {"BAG"}, {}, values)) return;
    for (const std::string& argument : disparity_refinement::bagArguments(values["BAG"].as<std::string>())) {
      std::puts(argument.c_str());
    }
  });
}
