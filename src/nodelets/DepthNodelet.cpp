#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <stereo_msgs/DisparityImage.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <pluginlib/class_list_macros.hpp>
#include <string>

#include "disparity_refinement/ros/FrameWorker.hpp"
#include "disparity_refinement/ros/LazyNodelet.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"
#include "disparity_refinement/ros/StartParameters.hpp"

namespace disparity_refinement {

/// disparity_refined, left/camera_info -> depth/image_rect, depth/camera_info (REP 118).
class DepthNodelet : public LazyNodelet {
 public:
  ~DepthNodelet() override {
    // First whoever calls this object from another thread.
    stop();
    if (monitor_) monitor_->stop();
    info_subscriber_.shutdown();
    disparity_subscriber_.shutdown();
    worker_.reset();
    monitor_.reset();
  }

 private:
  using CameraInfo = sensor_msgs::CameraInfo;
  using Disparity = stereo_msgs::DisparityImage;

  void onInit() override {
    ros::NodeHandle& nh = getNodeHandle();
    ros::NodeHandle& private_nh = getPrivateNodeHandle();
    monitor_ = std::make_unique<StageMonitor>(getName(), nh, private_nh);
    const auto queue_size = startFrames(private_nh, "queue_size", 1);
    worker_ = std::make_unique<FrameWorker<Disparity::ConstPtr>>(
        queue_size, *monitor_, [this](const Disparity::ConstPtr& disparity) { process(*disparity); });
    depth_publisher_ = advertise<sensor_msgs::Image>(nh, "depth/image_rect");
    info_publisher_ = advertise<CameraInfo>(nh, "depth/camera_info");
    monitor_->start();
    start();
  }

  void updateSubscriptions() override {
    const bool is_depth_wanted = isWanted(depth_publisher_);
    const bool is_wanted = isWanted(info_publisher_) || is_depth_wanted;
    monitor_->setActive(is_wanted);
    if (!is_wanted) {
      disparity_subscriber_.shutdown();
      info_subscriber_.shutdown();
    } else if (!disparity_subscriber_) {
      ros::NodeHandle& nh = getNodeHandle();
      const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
      info_subscriber_ = nh.subscribe<CameraInfo>(
          "left/camera_info", 1,
          [this](const CameraInfo::ConstPtr& info) {
            const std::lock_guard<std::mutex> lock(info_mutex_);
            info_ = info;
          },
          {}, hints);
      disparity_subscriber_ = nh.subscribe<Disparity>(
          "disparity_refined", INPUT_QUEUE_SIZE,
          [this](const Disparity::ConstPtr& disparity) { worker_->push(disparity); }, {}, hints);
    }
  }

  void process(const Disparity& in) {
    const ros::SteadyTime begin = ros::SteadyTime::now();
    const std::string topic = getNodeHandle().resolveName("disparity_refined");
    monitor_->traceReceived("disparity_refined", in.header.stamp, in.image.data.data());
    requireTime(in.header, topic);
    const cv::Mat disparity = imageView(in.image, sensor_msgs::image_encodings::TYPE_32FC1, topic);
    const auto depth =
        depthImage(in.header, disparity, disparityRange(in, topic), disparityGeometry(in, topic));
    monitor_->published(in.header.stamp, (ros::SteadyTime::now() - begin).toSec() * 1e3);
    monitor_->tracePublished("depth/image_rect", in.header.stamp, depth->data.data());
    publishInfo(in);
    depth_publisher_.publish(depth);
  }

  /// Any camera_info of the camera will do: the calibration does not change from frame to frame, and a frame
  /// shall not wait for it.
  void publishInfo(const Disparity& in) {
    CameraInfo::ConstPtr newest;
    {
      const std::lock_guard<std::mutex> lock(info_mutex_);
      newest = info_;
    }
    if (!newest) {
      monitor_->warning("no message on " + getNodeHandle().resolveName("left/camera_info") +
                        " yet: depth/image_rect is published without depth/camera_info");
      return;
    }
    const auto info = boost::make_shared<CameraInfo>(*newest);
    info->header = in.header;
    info_publisher_.publish(info);
  }

  std::unique_ptr<StageMonitor> monitor_;
  std::mutex info_mutex_;
  CameraInfo::ConstPtr info_;  // Of the last message.
  ros::Publisher depth_publisher_, info_publisher_;
  ros::Subscriber disparity_subscriber_, info_subscriber_;
  std::unique_ptr<FrameWorker<Disparity::ConstPtr>> worker_;
};

}  // namespace disparity_refinement

PLUGINLIB_EXPORT_CLASS(disparity_refinement::DepthNodelet, nodelet::Nodelet)
