#include "BagArguments.hpp"

#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <stdexcept>

#include "Format.hpp"
#include "OpenBag.hpp"

namespace disparity_refinement {
namespace {

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

/// ros::Duration is of 32 bits and throws beyond.
double secondsBetween(const ros::Time& a, const ros::Time& b) {
  return static_cast<double>(static_cast<std::int64_t>(a.toNSec()) - static_cast<std::int64_t>(b.toNSec())) /
         1e9;
}

/// Distance of a left image to the nearest right one [s]: the median, because a pair may be incomplete.
double stampOffset(const rosbag::Bag& bag, const StereoTopics& topics) {
  const std::vector<ros::Time> left = stamps(bag, topics.left + "/" + topics.image);
  const std::vector<ros::Time> right = stamps(bag, topics.right + "/" + topics.image);
  std::vector<double> offsets;
  for (const ros::Time& l : left) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const ros::Time& r : right) nearest = std::min(nearest, std::abs(secondsBetween(l, r)));
    offsets.push_back(nearest);
  }
  if (offsets.empty()) return 0.0;
  std::nth_element(offsets.begin(), offsets.begin() + offsets.size() / 2, offsets.end());
  return offsets[offsets.size() / 2];
}

/// Throws if the value would become two arguments.
std::string argument(const std::string& name, const std::string& value) {
  if (std::any_of(value.begin(), value.end(), [](char c) { return c == '\n' || c == '\r' || c == '\0'; })) {
    throw std::runtime_error(name + " would be \"" + value + "\", expected a text without a line break");
  }
  return name + ":=" + value;
}

}  // namespace

std::vector<std::string> bagArguments(const rosbag::Bag& bag) {
  rosbag::View view(bag);
  const StereoTopics topics = findPair(view);
  const std::string parent = topics.left.substr(0, topics.left.rfind('/'));
  std::vector<std::string> arguments = {
      argument("namespace", parent.empty() ? "/stereo" : parent), argument("left", topics.left),
      argument("right", topics.right), argument("image", topics.image),
      argument("camera_frame", frameId(bag, topics.left + "/" + topics.image))};
  const double offset = stampOffset(bag, topics);
  if (offset > 0.0) {
    arguments.push_back(argument("approximate_sync", "true"));
    arguments.push_back(
        argument("approximate_sync_max_interval", format("%.6f", std::max(0.01, 2.0 * offset))));
  }
  return arguments;
}

std::vector<std::string> bagArguments(const std::string& file) {
  rosbag::Bag bag;
  openBag(file, bag);
  try {
    return bagArguments(bag);
  } catch (const std::exception& error) {
    throw std::runtime_error(file + ": " + error.what());
  }
}

}  // namespace disparity_refinement
