// Finds the rectified stereo pair of a bag and prints the arguments that make kitti.launch play it, one a
// line. Usage: bag_arguments BAG

#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "CommandLine.hpp"
#include "OpenBag.hpp"

namespace {

constexpr const char* USAGE =
    R"(Usage: bag_arguments BAG

Finds the rectified stereo pair of a bag and prints the arguments with which kitti.launch
plays it, one a line.
)";

struct StereoTopics {
  std::string left, right, image;  ///< Namespaces of the cameras and name of the image topic.
};

bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

std::set<std::string> topicsOfType(rosbag::View& view, const std::string& type) {
  std::set<std::string> topics;
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
    if (connection->datatype == type) topics.insert(connection->topic);
  }
  return topics;
}

/// A left image, the right one under the same name, and both CameraInfos.
StereoTopics findPair(rosbag::View& view) {
  const std::set<std::string> images = topicsOfType(view, "sensor_msgs/Image");
  const std::set<std::string> infos = topicsOfType(view, "sensor_msgs/CameraInfo");
  // kitti2bag calls the rectified images of KITTI's raw drives image_raw.
  for (const std::string name : {"image_rect", "image_rect_color", "image_raw"}) {
    for (const std::string& topic : images) {
      if (!endsWith(topic, "/" + name) || (name == "image_raw" && topic.find("/kitti/") != 0)) continue;
      const std::string left = topic.substr(0, topic.size() - name.size() - 1);
      const auto side = left.rfind("left");
      if (side == std::string::npos) continue;
      std::string right = left;
      right.replace(side, 4, "right");
      if (images.count(right + "/" + name) > 0 && infos.count(left + "/camera_info") > 0 &&
          infos.count(right + "/camera_info") > 0) {
        return {left, right, name};
      }
    }
  }
  throw std::runtime_error(
      "no stereo pair found, expected image_rect (or image_rect_color) and camera_info in a "
      "namespace 'left' and one 'right'");
}

/// Stamps of the first messages of an image topic.
std::vector<ros::Time> stamps(const rosbag::Bag& bag, const std::string& topic) {
  constexpr std::size_t ENOUGH = 20;
  std::vector<ros::Time> result;
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  for (const rosbag::MessageInstance& message : view) {
    const auto image = message.instantiate<sensor_msgs::Image>();
    if (image) result.push_back(image->header.stamp);
    if (result.size() == ENOUGH) break;
  }
  return result;
}

std::string frameId(const rosbag::Bag& bag, const std::string& topic) {
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  for (const rosbag::MessageInstance& message : view) {
    const auto image = message.instantiate<sensor_msgs::Image>();
    if (image) return image->header.frame_id;
  }
  return "";
}

/// Distance of a left image to the nearest right one [s]: the median, because a pair may be incomplete.
double stampOffset(const rosbag::Bag& bag, const StereoTopics& topics) {
  const std::vector<ros::Time> left = stamps(bag, topics.left + "/" + topics.image);
  const std::vector<ros::Time> right = stamps(bag, topics.right + "/" + topics.image);
  std::vector<double> offsets;
  for (const ros::Time& l : left) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const ros::Time& r : right) nearest = std::min(nearest, std::abs((l - r).toSec()));
    offsets.push_back(nearest);
  }
  if (offsets.empty()) return 0.0;
  std::nth_element(offsets.begin(), offsets.begin() + offsets.size() / 2, offsets.end());
  return offsets[offsets.size() / 2];
}

void printArguments(const std::string& file) {
  rosbag::Bag bag;
  disparity_refinement::openBag(file, bag);
  rosbag::View view(bag);
  const StereoTopics topics = findPair(view);

  const auto slash = topics.left.rfind('/');
  const std::string parent = topics.left.substr(0, slash);
  std::printf("namespace:=%s\n", parent.empty() ? "/stereo" : parent.c_str());
  std::printf("left:=%s\nright:=%s\nimage:=%s\n", topics.left.c_str(), topics.right.c_str(),
              topics.image.c_str());
  std::printf("camera_frame:=%s\n", frameId(bag, topics.left + "/" + topics.image).c_str());
  const double offset = stampOffset(bag, topics);
  if (offset > 0.0) {
    std::printf("approximate_sync:=true\napproximate_sync_max_interval:=%.6f\n",
                std::max(0.01, 2.0 * offset));
  }
}

}  // namespace

int main(int argc, char** argv) {
  return disparity_refinement::runTool("bag_arguments", [&] {
    boost::program_options::variables_map values;
    if (disparity_refinement::parseCommandLine(argc, argv, USAGE, {"BAG"}, {}, values)) {
      printArguments(values["BAG"].as<std::string>());
    }
  });
}
