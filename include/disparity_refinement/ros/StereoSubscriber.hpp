#pragma once

#include <message_filters/pass_through.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <array>
#include <functional>
#include <memory>
#include <string>

#include "disparity_refinement/ros/ImageSubscriber.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"

namespace disparity_refinement {

/// One synchronized pair.
struct StereoFrame {
  sensor_msgs::ImageConstPtr left, right;
  sensor_msgs::CameraInfoConstPtr left_info, right_info;
};

/// Synchronizes left/image_rect, left/camera_info, right/image_rect and right/camera_info.
///
/// Parameters on the private handle: ~approximate_sync (false), ~approximate_sync_max_interval [s] (0.01),
/// ~queue_size [frames] (1), ~sync_warning_period [s] (5), ~image_transport (raw).
///
/// - Approximate pairs farther apart than the interval are rejected and counted. The same interval tells the
/// policy how
///   close two messages of one topic can follow each other at least: without it every pair waits for the next
///   one.
/// - A jump back in time (rosbag play --loop) starts a new synchronizer; the old one still gets what was
/// under way.
/// - Messages without a pair for a whole warning period: a warning says how many came on each topic, how far
/// the stamps
///   are apart and which parameter to set.
class StereoSubscriber {
 public:
  using Callback = std::function<void(const StereoFrame&)>;

  StereoSubscriber(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, StageMonitor& monitor,
                   Callback callback);

  ~StereoSubscriber();

  /// Throws image_transport::TransportLoadException if there is no such transport.
  void subscribe();
  /// No callback is under way when it returns.
  void unsubscribe();

  const std::string& leftImageTopic() const { return inputs_[LEFT_IMAGE].topic; }
  const std::string& leftInfoTopic() const { return inputs_[LEFT_INFO].topic; }
  const std::string& rightImageTopic() const { return inputs_[RIGHT_IMAGE].topic; }
  const std::string& rightInfoTopic() const { return inputs_[RIGHT_INFO].topic; }

 private:
  enum InputIndex { LEFT_IMAGE, LEFT_INFO, RIGHT_IMAGE, RIGHT_INFO };
  struct Input {
    std::string topic;
    ros::Time last;         ///< Stamp of the newest message.
    long total = 0;         ///< Messages.
    long received = 0;      ///< Messages since the last pair or warning.
    bool settling = false;  ///< Another topic jumped back in time, this one has not yet.
  };

  /// The synchronizer of message_filters and its four inputs.
  struct Synchronizer {
    message_filters::PassThrough<sensor_msgs::Image> left, right;
    message_filters::PassThrough<sensor_msgs::CameraInfo> left_info, right_info;
    std::shared_ptr<void> policy;  ///< Last: it is connected to the inputs.
  };

  template <class Message>
  void receive(InputIndex index, const boost::shared_ptr<const Message>& message,
               message_filters::PassThrough<Message> Synchronizer::*input);
  /// The synchronizer that a message belongs to: that of before a jump back in time, or the current one.
  Synchronizer& synchronizerFor(InputIndex index, const ros::Time& stamp);
  void measureOffset(InputIndex index, const ros::Time& stamp);
  std::unique_ptr<Synchronizer> makeSynchronizer();
  void pair(const sensor_msgs::ImageConstPtr& left, const sensor_msgs::CameraInfoConstPtr& left_info,
            const sensor_msgs::ImageConstPtr& right, const sensor_msgs::CameraInfoConstPtr& right_info);
  void checkForPairs();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  ros::NodeHandle nh_, private_nh_;
  StageMonitor& monitor_;
  const Callback callback_;
  bool approximate_;
  double max_interval_;
  int queue_size_;
  double warning_period_;

  std::array<Input, 4> inputs_;
  InputIndex jumped_ = LEFT_IMAGE;
  ros::Time jump_from_, jump_to_;
  double smallest_offset_ = -1.0;  ///< Between left and right images since the last pair [s], -1: unknown.
  long pairs_ = 0, pairs_at_last_check_ = 0, rejected_ = 0;
  double last_offset_ = 0.0;  ///< Left minus right image of the last pair, also of a rejected one [s].
  std::string problem_;       ///< What the last warning said, empty after a pair.

  bool subscribed_ = false;
  ImageSubscriber left_, right_;
  ros::Subscriber left_info_, right_info_;
  std::unique_ptr<Synchronizer> current_, previous_;
  ros::WallTimer timer_;
};

}  // namespace disparity_refinement
