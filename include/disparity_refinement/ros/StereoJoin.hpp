#pragma once

#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <functional>
#include <type_traits>
#include <utility>

namespace disparity_refinement {

/// One synchronized pair.
struct StereoFrame {
  sensor_msgs::ImageConstPtr left, right;
  sensor_msgs::CameraInfoConstPtr left_info, right_info;
};

/// Joins the four streams of a stereo camera: messages whose stamps all lie within `interval` [s], 0 for
/// equal stamps. A pair is complete with its last message and waits for no other.
///
/// Each stream keeps up to `capacity` messages in order of arrival, and arrival alone decides what is old: a
/// jump in time needs no special care, see StampJoin. Messages that a later pair has overtaken are dropped.
/// For triggered cameras the interval must be shorter than their period, or a lost image shifts the pairs.
class StereoJoin {
 public:
  using Emit = std::function<void(const StereoFrame&)>;
  /// Called with the number of images that were dropped without a partner.
  using Drop = std::function<void(int)>;

  StereoJoin(std::size_t capacity, double interval, Emit emit, Drop drop)
      : capacity_(capacity),
        interval_(std::llround(interval * 1e9)),
        emit_(std::move(emit)),
        drop_(std::move(drop)) {}

  void addLeft(const sensor_msgs::ImageConstPtr& image) { add(image, left_); }
  void addRight(const sensor_msgs::ImageConstPtr& image) { add(image, right_); }
  void addLeftInfo(const sensor_msgs::CameraInfoConstPtr& info) { add(info, left_info_); }
  void addRightInfo(const sensor_msgs::CameraInfoConstPtr& info) { add(info, right_info_); }

  void clear() {
    left_.clear();
    right_.clear();
    left_info_.clear();
    right_info_.clear();
  }

 private:
  /// In nanoseconds: ros::Duration throws where it cannot span the difference.
  template <class Message>
  static std::int64_t nanoseconds(const Message& message) {
    return static_cast<std::int64_t>(message->header.stamp.toNSec());
  }

  /// The message nearest in time, of equally near ones the newest: what is left of an earlier loop is older.
  template <class Message>
  static typename std::deque<Message>::const_iterator nearest(const std::deque<Message>& stream,
                                                              std::int64_t time) {
    auto result = stream.end();
    std::int64_t smallest = 0;
    for (auto message = stream.begin(); message != stream.end(); ++message) {
      const std::int64_t distance = std::abs(nanoseconds(*message) - time);
      if (result != stream.end() && distance > smallest) continue;
      result = message;
      smallest = distance;
    }
    return result;
  }

  /// The number of messages before `last`.
  template <class Message>
  static int eraseThrough(std::deque<Message>& stream, typename std::deque<Message>::const_iterator last) {
    const auto overtaken = static_cast<int>(last - stream.cbegin());
    stream.erase(stream.cbegin(), last + 1);
    return overtaken;
  }

  template <class Message>
  void add(const Message& message, std::deque<Message>& stream) {
    stream.push_back(message);
    if (joinAt(nanoseconds(message)) || stream.size() <= capacity_) return;
    stream.pop_front();
    if (std::is_same<Message, sensor_msgs::ImageConstPtr>::value) drop(1);
  }

  bool joinAt(std::int64_t time) {
    const auto left = nearest(left_, time);
    const auto right = nearest(right_, time);
    const auto left_info = nearest(left_info_, time);
    const auto right_info = nearest(right_info_, time);
    if (left == left_.end() || right == right_.end() || left_info == left_info_.end() ||
        right_info == right_info_.end()) {
      return false;
    }
    const auto [first, last] = std::minmax(
        {nanoseconds(*left), nanoseconds(*right), nanoseconds(*left_info), nanoseconds(*right_info)});
    if (last - first > interval_) return false;
    const StereoFrame frame{*left, *right, *left_info, *right_info};
    drop(eraseThrough(left_, left) + eraseThrough(right_, right));
    eraseThrough(left_info_, left_info);
    eraseThrough(right_info_, right_info);
    emit_(frame);
    return true;
  }

  void drop(int images) {
    if (images > 0) drop_(images);
  }

  const std::size_t capacity_;
  const std::int64_t interval_;  ///< [ns]
  const Emit emit_;
  const Drop drop_;
  std::deque<sensor_msgs::ImageConstPtr> left_, right_;
  std::deque<sensor_msgs::CameraInfoConstPtr> left_info_, right_info_;
};

}  // namespace disparity_refinement
