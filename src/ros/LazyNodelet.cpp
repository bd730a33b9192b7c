#include "disparity_refinement/ros/LazyNodelet.hpp"

#include <exception>

#include "disparity_refinement/ros/ImageSubscriber.hpp"
#include "disparity_refinement/ros/StartParameters.hpp"

namespace disparity_refinement {

image_transport::Publisher LazyNodelet::advertiseImage(image_transport::ImageTransport& transport,
                                                       const std::string& topic) {
  const image_transport::SubscriberStatusCallback changed =
      [this](const image_transport::SingleSubscriberPublisher&) { update(); };
  const std::lock_guard<std::mutex> lock(imageTransportMutex());
  return transport.advertise(topic, PUBLISHER_QUEUE_SIZE, changed, changed);
}

void LazyNodelet::start() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    lazy_ = startParameter(getPrivateNodeHandle(), "lazy", true);
    started_ = true;
  }
  update();
}

void LazyNodelet::stop() {
  const std::lock_guard<std::mutex> lock(mutex_);
  started_ = false;
}

void LazyNodelet::update() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!started_) return;
  try {
    updateSubscriptions();
  } catch (const std::exception& e) {
    // An unknown image_transport, say. It would end the manager, for this is a callback of roscpp.
    NODELET_ERROR_STREAM("[" << getName() << "] cannot subscribe: " << e.what());
  }
}

}  // namespace disparity_refinement
