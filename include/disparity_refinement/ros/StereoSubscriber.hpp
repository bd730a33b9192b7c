#pragma once

#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <array>
#include <cstddef>
#include <functional>
#include <string>

#include "disparity_refinement/ros/ImageSubscriber.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"
#include "disparity_refinement/ros/StereoJoin.hpp"

namespace disparity_refinement {

/// Synchronizes left/image_rect, left/camera_info, right/image_rect and right/camera_info.
///
/// Parameters on the private handle: ~approximate_sync (false), ~approximate_sync_max_interval [s] (0.01),
/// ~sync_warning_period [s] (5), ~image_transport (raw).
///
/// - Messages without a time of exposure are refused with an error, see ImageSubscriber.
/// - Images without a partner are counted.
/// - Messages without a pair for a whole warning period: a warning says how many came on each topic, how far
///   the stamps are apart and what to do.
class StereoSubscriber {
 public:
  using Callback = std::function<void(const StereoFrame&)>;

  /// @param queue_size  Frames that may wait for the stage: so many messages wait for their partners, or 30.
  StereoSubscriber(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, std::size_t queue_size,
                   StageMonitor& monitor, Callback callback);

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
    ros::Time last;     ///< Stamp of the newest message.
    long total = 0;     ///< Messages.
    long received = 0;  ///< Messages since the last pair or warning.
  };
  /// Two inputs whose stamps should agree, and how far they are apart.
  struct Offset {
    InputIndex first, second;
    double smallest;  ///< Since the last pair or warning [s], UNKNOWN: not both came.
  };
  static constexpr double UNKNOWN = -1.0;

  ros::Subscriber subscribeInfo(InputIndex index,
                                void (StereoJoin::*add)(const sensor_msgs::CameraInfoConstPtr&));
  void subscribeImage(InputIndex index, ImageSubscriber& subscriber,
                      void (StereoJoin::*add)(const sensor_msgs::ImageConstPtr&));
  /// Counts a message and measures how far its stamp is from the others.
  void note(InputIndex index, const ros::Time& stamp);
  void startAnew();
  void pair(const StereoFrame& frame);
  void checkForPairs();
  std::string advice() const;
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  ros::NodeHandle nh_, private_nh_;
  StageMonitor& monitor_;
  const Callback callback_;
  const bool approximate_;
  const double max_interval_;
  const std::size_t queue_size_;
  const double warning_period_;

  std::array<Input, 4> inputs_;
  std::array<Offset, 3> offsets_{{{LEFT_IMAGE, RIGHT_IMAGE, UNKNOWN},
                                  {LEFT_INFO, LEFT_IMAGE, UNKNOWN},
                                  {RIGHT_INFO, RIGHT_IMAGE, UNKNOWN}}};
  double period_ = UNKNOWN;  ///< Smallest distance of two left images since the last pair or warning [s].
  long pairs_ = 0, pairs_at_last_check_ = 0, unpaired_ = 0;
  double last_offset_ = 0.0;  ///< Left minus right image of the last pair [s].
  std::string problem_;       ///< What the last warning said, empty after a pair.

  StereoJoin join_;
  bool subscribed_ = false;
  ImageSubscriber left_, right_;
  ros::Subscriber left_info_, right_info_;
  ros::SteadyTimer timer_;
};

}  // namespace disparity_refinement
