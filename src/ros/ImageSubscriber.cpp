#include "disparity_refinement/ros/ImageSubscriber.hpp"

namespace disparity_refinement {

std::mutex& imageTransportMutex() {
  static std::mutex mutex;
  return mutex;
}

void ImageSubscriber::subscribe(ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                                const std::string& topic, std::uint32_t queue_size,
                                const Callback& callback) {
  const ros::TransportHints ros_hints = ros::TransportHints().tcpNoDelay();
  const image_transport::TransportHints hints("raw", ros_hints, private_nh);
  if (hints.getTransport() == "raw") {
    raw_ = nh.subscribe<sensor_msgs::Image>(topic, queue_size, callback, ros::VoidConstPtr(), ros_hints);
    return;
  }
  const std::lock_guard<std::mutex> lock(imageTransportMutex());
  if (!transport_) transport_ = std::make_unique<image_transport::ImageTransport>(nh);
  other_ = transport_->subscribe(topic, queue_size, callback, ros::VoidPtr(), hints);
}

void ImageSubscriber::shutdown() {
  raw_.shutdown();
  if (!transport_) return;
  // Without the mutex: it waits for a callback.
  other_.shutdown();
  const std::lock_guard<std::mutex> lock(imageTransportMutex());
  other_ = image_transport::Subscriber();
  transport_.reset();
}

}  // namespace disparity_refinement
