// Watches a running chain while its parameters change, and computes some of its frames again, by the core and
// the parameters that the planes message says: disparity, labels and refined disparity have to be the same
// bits, or a frame was made with mixed parameters or of images that do not belong together. Writes what it
// counted as JSON when it ends. Started by soak.launch.

#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <stereo_msgs/DisparityImage.h>

#include <atomic>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>

#include "disparity_refinement/Planes.h"
#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/StereoGeometry.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {
namespace {

using sensor_msgs::CameraInfo;
using sensor_msgs::Image;
using stereo_msgs::DisparityImage;

/// Everything that was published with one stamp.
struct Frame {
  ros::WallTime begin = ros::WallTime::now();
  Image::ConstPtr left, right, labels;
  CameraInfo::ConstPtr left_info, right_info;
  DisparityImage::ConstPtr disparity, refined;
  Planes::ConstPtr planes;

  bool isComplete() const {
    return left && right && labels && left_info && right_info && disparity && refined && planes;
  }
};

template <class Config>
auto parametersOf(dynamic_reconfigure::Config message) {
  Config config = Config::__getDefault__();
  config.__fromMessage__(message);
  return toParameters(config);
}

bool sameBits(const cv::Mat& expected, const cv::Mat& actual) {
  return expected.size() == actual.size() && expected.type() == actual.type() &&
         std::memcmp(expected.data, actual.data, expected.total() * expected.elemSize()) == 0;
}

/// What is not as the core makes it, empty if everything is.
std::string differenceOf(const Frame& frame) {
  namespace enc = sensor_msgs::image_encodings;
  const auto left = grayImage(frame.left, "left"), right = grayImage(frame.right, "right");
  const double offset = stereoGeometry(*frame.left_info, *frame.right_info).principal_point_offset;
  StereoMatcher matcher(parametersOf<DisparityConfig>(frame.planes->disparity_parameters));
  cv::Mat disparity, labels, refined;
  matcher.compute(left->image, right->image, disparity, offset);
  const cv::Mat disparity_seen = imageView(frame.disparity->image, enc::TYPE_32FC1, "disparity");
  if (!sameBits(disparity, disparity_seen)) return "disparity";

  Segmentation segmentation;
  segmentation.compute(left->image, parametersOf<SegmentationConfig>(frame.planes->segmentation_parameters),
                       labels);
  if (!sameBits(labels, imageView(*frame.labels, enc::TYPE_32SC1, "labels"))) return "labels";

  const StereoGeometry geometry = disparityGeometry(*frame.disparity, "disparity");
  DisparityRefinement refinement;
  refinement.refine(disparity_seen, labels, left->image, disparityRange(*frame.disparity, "disparity"),
                    geometry.focal_length * geometry.baseline,
                    parametersOf<PlaneRefinementConfig>(frame.planes->refinement_parameters), refined);
  if (!sameBits(refined, imageView(frame.refined->image, enc::TYPE_32FC1, "refined"))) return "refined";
  return {};
}

class SoakCheck {
 public:
  SoakCheck() {
    listen("left/image_rect", &Frame::left);
    listen("right/image_rect", &Frame::right);
    listen("left/camera_info", &Frame::left_info);
    listen("right/camera_info", &Frame::right_info);
    listen("labels", &Frame::labels);
    listen("disparity", &Frame::disparity);
    listen("disparity_refined", &Frame::refined);
    listen("planes", &Frame::planes);
    checker_ = std::thread([this] { check(); });
  }

  ~SoakCheck() {
    stop_ = true;
    checker_.join();
  }

  void write(const std::string& file) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::ofstream(file) << nlohmann::json{{"messages", messages_},
                                          {"checked", checked_},
                                          {"without_parameters", without_parameters_.load()},
                                          {"differences", differences_}};
  }

 private:
  /// Of a bag that is played again and again, the same stamps come again: frames as old as this are
  /// forgotten.
  static constexpr double PATIENCE = 4.0;  // [s]
  /// Between two frames that are computed again, so that the chain has the processors.
  static constexpr double PAUSE = 1.0;  // [s]

  template <class Message>
  void listen(const std::string& topic, boost::shared_ptr<const Message> Frame::*part) {
    using Pointer = boost::shared_ptr<const Message>;
    const boost::function<void(const Pointer&)> keep = [this, topic, part](const Pointer& message) {
      const std::lock_guard<std::mutex> lock(mutex_);
      ++messages_[topic];
      const ros::WallTime oldest = ros::WallTime::now() - ros::WallDuration(PATIENCE);
      for (auto frame = frames_.begin(); frame != frames_.end();) {
        frame = frame->second.begin < oldest ? frames_.erase(frame) : std::next(frame);
      }
      Frame& frame = frames_[message->header.stamp];
      frame.*part = message;
      if (frame.isComplete()) newest_complete_ = frame;
    };
    constexpr std::uint32_t QUEUE = 1000;
    subscribers_.push_back(nh_.subscribe<Message>(topic, QUEUE, keep));
  }

  void check() {
    while (!stop_) {
      ros::WallDuration(PAUSE).sleep();
      std::optional<Frame> frame;
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        std::swap(frame, newest_complete_);
      }
      if (!frame) continue;
      if (frame->planes->disparity_parameters.ints.empty() ||
          frame->planes->segmentation_parameters.ints.empty()) {
        ++without_parameters_;
        continue;
      }
      std::string difference;
      try {
        difference = differenceOf(*frame);
      } catch (const std::exception& e) {
        difference = e.what();
      }
      const std::lock_guard<std::mutex> lock(mutex_);
      ++checked_;
      if (difference.empty()) continue;
      ROS_ERROR_STREAM("stamp " << frame->planes->header.stamp << ": " << difference
                                << " is not what the core makes with\n"
                                << *frame->planes);
      ++differences_[difference];
    }
  }

  ros::NodeHandle nh_;
  mutable std::mutex mutex_;
  std::map<ros::Time, Frame> frames_;
  std::optional<Frame> newest_complete_;
  std::map<std::string, long> messages_, differences_;
  long checked_ = 0;
  std::atomic<long> without_parameters_{0};
  std::atomic<bool> stop_{false};
  std::vector<ros::Subscriber> subscribers_;
  std::thread checker_;
};

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  ros::init(argc, argv, "soak_check");
  const ros::NodeHandle private_nh("~");
  const auto output = private_nh.param<std::string>("output", "soak_check.json");
  disparity_refinement::SoakCheck check;
  ros::spin();
  check.write(output);
}
