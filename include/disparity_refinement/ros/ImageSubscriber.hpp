#pragma once

#include <image_transport/image_transport.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "disparity_refinement/ros/StageMonitor.hpp"

namespace disparity_refinement {

/// To be held while image_transport loads plugins: it makes an ImageTransport, advertises, or subscribes by
/// another transport than "raw".
std::mutex& imageTransportMutex();

/// Subscription to an image topic by the transport that ~image_transport names, "raw" by default.
///
/// Lazy nodelets subscribe on any thread of their manager. class_loader does not withstand two threads that
/// load plugins at the same time: one of them gets no plugin, or the manager crashes. So "raw" does without a
/// plugin, and the other transports are loaded one at a time.
///
/// Frames are told apart by their stamps. So an image without a time of exposure is refused with an error,
/// and so is one with the stamp of the image before it but another content: a clock that stands still. The
/// same image again, as of a bag of one frame that is played in a loop, is taken.
class ImageSubscriber {
 public:
  using Callback = std::function<void(const sensor_msgs::ImageConstPtr&)>;

  ImageSubscriber() = default;
  ~ImageSubscriber() { shutdown(); }
  ImageSubscriber(const ImageSubscriber&) = delete;
  ImageSubscriber& operator=(const ImageSubscriber&) = delete;

  /// Throws image_transport::TransportLoadException if there is no such transport.
  void subscribe(ros::NodeHandle& nh, const ros::NodeHandle& private_nh, const std::string& topic,
                 std::uint32_t queue_size, StageMonitor& monitor, const Callback& callback);

  /// No callback is under way when it returns.
  void shutdown();

  bool isSubscribed() const { return raw_ || other_; }

 private:
  /// Throws if the image cannot be told from others by its stamp.
  void check(const sensor_msgs::ImageConstPtr& image, const std::string& topic);

  sensor_msgs::ImageConstPtr last_;
  ros::Subscriber raw_;
  std::unique_ptr<image_transport::ImageTransport> transport_;
  image_transport::Subscriber other_;
};

}  // namespace disparity_refinement
