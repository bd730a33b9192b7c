#include "disparity_refinement/ros/ImageSubscriber.hpp"

#include <exception>
#include <stdexcept>

#include "disparity_refinement/ros/Messages.hpp"

namespace disparity_refinement {

std::mutex& imageTransportMutex() {
  static std::mutex mutex;
  return mutex;
}

void ImageSubscriber::subscribe(ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                                const std::string& topic, std::uint32_t queue_size, StageMonitor& monitor,
                                const Callback& callback) {
  const auto receive = [this, &monitor, callback,
                        name = nh.resolveName(topic)](const sensor_msgs::ImageConstPtr& image) {
    try {
      check(image, name);
    } catch (const std::exception& e) {
      monitor.error(e.what());
      return;
    }
    callback(image);
  };
  const ros::TransportHints ros_hints = ros::TransportHints().tcpNoDelay();
  const image_transport::TransportHints hints("raw", ros_hints, private_nh);
  if (hints.getTransport() == "raw") {
    raw_ = nh.subscribe<sensor_msgs::Image>(topic, queue_size, receive, ros::VoidConstPtr(), ros_hints);
    return;
  }
  const std::lock_guard<std::mutex> lock(imageTransportMutex());
  if (!transport_) transport_ = std::make_unique<image_transport::ImageTransport>(nh);
  other_ = transport_->subscribe(topic, queue_size, receive, ros::VoidPtr(), hints);
}

void ImageSubscriber::check(const sensor_msgs::ImageConstPtr& image, const std::string& topic) {
  requireTime(image->header, topic);
  const bool is_repeated = last_ && last_->header.stamp == image->header.stamp;
  if (is_repeated && last_->data != image->data) {
    throw std::invalid_argument(
        topic +
        ": several images with the same stamp, expected the time of exposure of each; "
        "only the first is taken");
  }
  last_ = image;
}

void ImageSubscriber::shutdown() {
  raw_.shutdown();
  if (transport_) {
    // Without the mutex: it waits for a callback.
    other_.shutdown();
    const std::lock_guard<std::mutex> lock(imageTransportMutex());
    other_ = image_transport::Subscriber();
    transport_.reset();
  }
  last_.reset();
}

}  // namespace disparity_refinement
