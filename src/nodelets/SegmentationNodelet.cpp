#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "disparity_refinement/ros/FrameGate.hpp"
#include "disparity_refinement/ros/FrameWorker.hpp"
#include "disparity_refinement/ros/ImageSubscriber.hpp"
#include "disparity_refinement/ros/LazyNodelet.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"
#include "disparity_refinement/ros/StartParameters.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {

/// left/image_rect -> labels. Of the frames of disparity_parameters, while there are any.
class SegmentationNodelet : public LazyNodelet {
 public:
  ~SegmentationNodelet() override {
    // First whoever calls this object from another thread.
    stop();
    if (monitor_) monitor_->stop();
    patience_timer_.stop();
    subscriber_.shutdown();
    announcement_subscriber_.shutdown();
    worker_.reset();
    monitor_.reset();
  }

 private:
  void onInit() override {
    ros::NodeHandle& nh = getNodeHandle();
    ros::NodeHandle& private_nh = getPrivateNodeHandle();
    monitor_ = std::make_unique<StageMonitor>(getName(), nh, private_nh);
    monitor_->addDiagnostics([this](diagnostic_updater::DiagnosticStatusWrapper& status) {
      const auto snapshot = parameters_->snapshot();
      const SegmentationParameters& parameters = snapshot->parameters;
      status.add("segments", segments_.load());
      status.add("lambda [px]", parameters.lambda);
      status.add("h [gray levels]", parameters.h);
    });
    parameters_ = std::make_unique<LiveParameters<SegmentationConfig>>(private_nh);
    const auto queue_size = startFrames(private_nh, "queue_size", 5);
    threads_ = startParameter(private_nh, "segmentation_threads", 1, 1, FilteredWatershed::MAX_STRIPS);
    worker_ = std::make_unique<FrameWorker<sensor_msgs::ImageConstPtr>>(
        queue_size, *monitor_, [this](const sensor_msgs::ImageConstPtr& image) { process(image); });
    is_following_ = startParameter(private_nh, "follow_disparity", true);
    // More than a second without a disparity map: there is no matcher, or one that does not care.
    gate_ = std::make_unique<FrameGate<sensor_msgs::Image>>(
        queue_size + 2, ros::WallDuration(1.0),
        [this](const sensor_msgs::ImageConstPtr& image) { worker_->push(image); },
        [this](int frames) {
          monitor_->received(frames);
          monitor_->dropped(DropReason::NO_PARTNER, frames);
        });
    patience_timer_ = private_nh.createSteadyTimer(ros::WallDuration(0.25),
                                                   [this](const ros::SteadyTimerEvent&) { gate_->expire(); });
    publisher_ = advertise<sensor_msgs::Image>(nh, "labels");
    parameters_publisher_ = nh.advertise<FrameParameters>("segmentation_parameters", PUBLISHER_QUEUE_SIZE);
    monitor_->start();
    start();
  }

  void updateSubscriptions() override {
    const bool is_wanted = isWanted(publisher_);
    monitor_->setActive(is_wanted);
    if (!is_wanted) {
      subscriber_.shutdown();
      announcement_subscriber_.shutdown();
    } else if (!subscriber_.isSubscribed()) {
      if (is_following_) {
        announcement_subscriber_ = getNodeHandle().subscribe<FrameParameters>(
            "disparity_parameters", INPUT_QUEUE_SIZE,
            [this](const FrameParameters::ConstPtr& begun) { gate_->announce(begun->header.stamp); }, {},
            ros::TransportHints().tcpNoDelay());
      }
      subscriber_.subscribe(getNodeHandle(), getPrivateNodeHandle(), "left/image_rect", INPUT_QUEUE_SIZE,
                            *monitor_,
                            [this](const sensor_msgs::ImageConstPtr& image) { gate_->addFrame(image); });
    }
  }

  void process(const sensor_msgs::ImageConstPtr& image) {
    const ros::SteadyTime begin = ros::SteadyTime::now();
    const auto snapshot = parameters_->snapshot();
    const SegmentationParameters& parameters = snapshot->parameters;
    if (snapshot != snapshot_) segmentation_ = std::make_unique<Segmentation>(threads_);
    snapshot_ = snapshot;
    monitor_->traceReceived("left/image_rect", image->header.stamp, image->data.data());
    const auto gray = grayImage(image, getNodeHandle().resolveName("left/image_rect"));

    const auto message =
        makeImage(image->header, gray->image.size(), sensor_msgs::image_encodings::TYPE_32SC1);
    cv::Mat labels = imageView(*message, sensor_msgs::image_encodings::TYPE_32SC1, "labels");
    segments_ = segmentation_->compute(gray->image, parameters, labels);
    ROS_DEBUG_STREAM("[" << getName() << "] " << segments_ << " segments (lambda " << parameters.lambda
                         << " px, h " << parameters.h << ")");
    monitor_->published(message->header.stamp, (ros::SteadyTime::now() - begin).toSec() * 1e3);
    monitor_->tracePublished("labels", message->header.stamp, message->data.data());
    // First, so that it is there when the labels are.
    publishParameters(parameters_publisher_, message->header, snapshot->message);
    publisher_.publish(message);
  }

  std::unique_ptr<StageMonitor> monitor_;
  std::unique_ptr<LiveParameters<SegmentationConfig>> parameters_;
  std::shared_ptr<const LiveParameters<SegmentationConfig>::Snapshot> snapshot_;  // Of the frame before.
  std::unique_ptr<Segmentation> segmentation_;
  std::atomic<int> segments_{0};
  int threads_ = 1;
  bool is_following_ = true;
  ros::Publisher publisher_, parameters_publisher_;
  std::unique_ptr<FrameGate<sensor_msgs::Image>> gate_;
  ImageSubscriber subscriber_;
  ros::Subscriber announcement_subscriber_;
  ros::SteadyTimer patience_timer_;
  std::unique_ptr<FrameWorker<sensor_msgs::ImageConstPtr>> worker_;
};

}  // namespace disparity_refinement

PLUGINLIB_EXPORT_CLASS(disparity_refinement::SegmentationNodelet, nodelet::Nodelet)
