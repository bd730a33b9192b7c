#pragma once

#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <opencv2/core.hpp>
#include <string>
#include <thread>
#include <vector>

#include "disparity_refinement/evaluation/SyntheticStreet.hpp"
#include "disparity_refinement/ros/Messages.hpp"

/// What the tests of the nodelets share: a stereo camera, listeners that wait, and the log.
namespace disparity_refinement {

constexpr double TIMEOUT = 20.0;  ///< Time that a loaded machine may take for one frame [s].

/// Waits until `condition` holds; false after the timeout.
inline bool waitFor(const std::function<bool()>& condition, double timeout = TIMEOUT) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(timeout);
  while (ros::ok() && ros::WallTime::now() < end) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return condition();
}

/// Keeps the messages of a topic. Needs an AsyncSpinner.
template <class Message>
class Listener {
 public:
  using ConstPtr = boost::shared_ptr<const Message>;

  Listener(ros::NodeHandle& nh, const std::string& topic) {
    const boost::function<void(const ConstPtr&)> keep = [this](const ConstPtr& message) {
      const std::lock_guard<std::mutex> lock(mutex_);
      messages_.push_back(message);
      arrived_.notify_all();
    };
    subscriber_ = nh.subscribe<Message>(topic, 1000, keep);
  }

  ~Listener() { subscriber_.shutdown(); }

  bool isConnected() const { return subscriber_.getNumPublishers() > 0; }

  /// The first message for which `matches` holds, null after the timeout.
  ConstPtr wait(const std::function<bool(const Message&)>& matches, double timeout = TIMEOUT) {
    std::unique_lock<std::mutex> lock(mutex_);
    ConstPtr found;
    arrived_.wait_for(lock, std::chrono::duration<double>(timeout), [&] {
      const auto message =
          std::find_if(messages_.begin(), messages_.end(), [&](const ConstPtr& m) { return matches(*m); });
      if (message != messages_.end()) found = *message;
      return found != nullptr;
    });
    return found;
  }

  ConstPtr wait(const ros::Time& stamp, double timeout = TIMEOUT) {
    return wait([&stamp](const Message& message) { return message.header.stamp == stamp; }, timeout);
  }

  std::vector<ConstPtr> all() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }

  std::size_t count() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_.size();
  }

  void clear() {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages_.clear();
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  std::vector<ConstPtr> messages_;
  ros::Subscriber subscriber_;
};

/// True once a message at `level` or above that holds all `words` is in the log.
class LogListener {
 public:
  explicit LogListener(ros::NodeHandle& nh) : listener_(nh, "/rosout") {}

  bool waitFor(const std::vector<std::string>& words, int level = rosgraph_msgs::Log::WARN,
               double timeout = TIMEOUT) {
    return listener_.wait(
               [&](const rosgraph_msgs::Log& log) {
                 return log.level >= level &&
                        std::all_of(words.begin(), words.end(), [&log](const std::string& word) {
                          return log.msg.find(word) != std::string::npos;
                        });
               },
               timeout) != nullptr;
  }

  void clear() { listener_.clear(); }
  Listener<rosgraph_msgs::Log>& messages() { return listener_; }

 private:
  Listener<rosgraph_msgs::Log> listener_;
};

/// A pair of messages as a stereo driver would publish it; tests spoil it before it is sent.
struct StereoMessages {
  sensor_msgs::ImagePtr left, right;
  sensor_msgs::CameraInfoPtr left_info, right_info;
};

/// A rectified stereo camera on the synthetic street. `image` is the name of its images.
class StereoCamera {
 public:
  explicit StereoCamera(ros::NodeHandle& nh, const StreetParameters& parameters = smallStreet(),
                        const std::string& image = "image_rect")
      : street_(parameters) {
    left_ = nh.advertise<sensor_msgs::Image>("left/" + image, 100);
    right_ = nh.advertise<sensor_msgs::Image>("right/" + image, 100);
    left_info_ = nh.advertise<sensor_msgs::CameraInfo>("left/camera_info", 100);
    right_info_ = nh.advertise<sensor_msgs::CameraInfo>("right/camera_info", 100);
  }

  static StreetParameters smallStreet() {
    StreetParameters parameters;
    parameters.width = 320;
    parameters.height = 120;
    parameters.focal_length = 200.0;
    return parameters;
  }

  const SyntheticStreet& street() const { return street_; }

  /// Stamps are 0.1 s apart, whatever the wall clock says; a negative index gives an earlier one.
  static ros::Time stamp(int index) { return ros::Time(1000, 0) + ros::Duration(0.1) * index; }

  StereoMessages make(int index) const {
    const StreetFrame frame = street_.render(std::max(0, index));
    return make(frame.left, frame.right, stamp(index));
  }

  StereoMessages make(const cv::Mat& left, const cv::Mat& right, const ros::Time& time) const {
    StereoMessages messages;
    std_msgs::Header header;
    header.stamp = time;
    header.frame_id = "stereo_left";
    messages.left = image(header, left);
    messages.right = image(header, right);
    messages.left_info = info(header, left.size(), 0.0);
    messages.right_info =
        info(header, right.size(), -street_.parameters().focal_length * street_.parameters().baseline);
    return messages;
  }

  /// What is null does not come.
  void publish(const StereoMessages& messages) {
    if (messages.left_info) left_info_.publish(messages.left_info);
    if (messages.right_info) right_info_.publish(messages.right_info);
    if (messages.left) left_.publish(messages.left);
    if (messages.right) right_.publish(messages.right);
  }

  /// Publishes frame `index`; its stamp.
  ros::Time publish(int index) {
    publish(make(index));
    return stamp(index);
  }

  int leftSubscribers() const { return static_cast<int>(left_.getNumSubscribers()); }
  int rightSubscribers() const { return static_cast<int>(right_.getNumSubscribers()); }
  int infoSubscribers() const {
    return static_cast<int>(std::min(left_info_.getNumSubscribers(), right_info_.getNumSubscribers()));
  }

  /// Sends frames with earlier stamps until one reaches the listener: the nodelets of a lazy chain connect
  /// one after the other.
  template <class Message>
  bool waitForChain(Listener<Message>& listener) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(TIMEOUT);
    for (int i = -1000; ros::WallTime::now() < end; ++i) {
      publish(i);
      const auto any = [](const Message&) { return true; };
      if (listener.wait(any, 0.3)) return true;
    }
    return false;
  }

  static sensor_msgs::ImagePtr image(const std_msgs::Header& header, const cv::Mat& picture,
                                     const std::string& encoding = sensor_msgs::image_encodings::MONO8) {
    return cv_bridge::CvImage(header, encoding, picture).toImageMsg();
  }

 private:
  sensor_msgs::CameraInfoPtr info(const std_msgs::Header& header, const cv::Size& size, double tx) const {
    const double f = street_.parameters().focal_length;
    const cv::Point2d c = street_.principalPoint();
    const auto info = boost::make_shared<sensor_msgs::CameraInfo>();
    info->header = header;
    info->width = static_cast<std::uint32_t>(size.width);
    info->height = static_cast<std::uint32_t>(size.height);
    info->distortion_model = "plumb_bob";
    info->D.assign(5, 0.0);
    info->K = {f, 0, c.x, 0, f, c.y, 0, 0, 1};
    info->R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    info->P = {f, 0, c.x, tx, 0, f, c.y, 0, 0, 0, 1, 0};
    return info;
  }

  SyntheticStreet street_;
  ros::Publisher left_, right_, left_info_, right_info_;
};

}  // namespace disparity_refinement
