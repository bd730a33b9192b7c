#pragma once

#include <image_transport/image_transport.h>
#include <nodelet/nodelet.h>
#include <ros/ros.h>

#include <mutex>
#include <string>

namespace disparity_refinement {

/// Nodelet that subscribes to its inputs only while somebody listens to its outputs.
///
/// onInit() builds everything, advertises through this class and calls start() last: connections may be
/// reported by another thread while onInit() is still at work. The parameter ~lazy (default true) switches
/// the behaviour off.
class LazyNodelet : public nodelet::Nodelet {
 protected:
  static constexpr int PUBLISHER_QUEUE_SIZE = 10;
  /// Messages that may wait for a callback of the nodelet, which hands them on at once: none is lost unseen
  /// while the manager's thread is late, however few frames may wait for the stage.
  static constexpr int INPUT_QUEUE_SIZE = 30;

  template <class Message>
  ros::Publisher advertise(ros::NodeHandle& nh, const std::string& topic) {
    const ros::SubscriberStatusCallback changed = [this](const ros::SingleSubscriberPublisher&) { update(); };
    return nh.advertise<Message>(topic, PUBLISHER_QUEUE_SIZE, changed, changed);
  }

  image_transport::Publisher advertiseImage(image_transport::ImageTransport& transport,
                                            const std::string& topic);

  /// Ends onInit(): from here on updateSubscriptions() is called.
  void start();

  /// Begins the destructor of a derived class: updateSubscriptions() is not called any more.
  void stop();

  /// Calls updateSubscriptions() between start() and stop(). An exception is logged.
  void update();

  /// Subscribe to what isWanted() and shut down the rest. Called whenever a listener comes or goes, and by
  /// update().
  virtual void updateSubscriptions() = 0;

  template <class Publisher>
  bool isWanted(const Publisher& publisher) {
    if (!lazy_) return true;
    const bool is_heard = publisher.getNumSubscribers() > 0;
    if (is_heard && !was_heard_) {
      was_heard_ = true;
      NODELET_INFO_STREAM("[" << getName() << "] first listener, on " << publisher.getTopic()
                              << ": starting");
    }
    return is_heard;
  }

 private:
  std::mutex mutex_;
  bool started_ = false;
  bool lazy_ = true;
  bool was_heard_ = false;
};

}  // namespace disparity_refinement
