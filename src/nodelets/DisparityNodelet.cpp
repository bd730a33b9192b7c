#include <ros/ros.h>
#include <std_msgs/Header.h>
#include <stereo_msgs/DisparityImage.h>

#include <algorithm>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <pluginlib/class_list_macros.hpp>
#include <stdexcept>
#include <string>

#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/ros/FlowControl.hpp"
#include "disparity_refinement/ros/FrameWorker.hpp"
#include "disparity_refinement/ros/LazyNodelet.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"
#include "disparity_refinement/ros/StartParameters.hpp"
#include "disparity_refinement/ros/StereoSubscriber.hpp"

namespace disparity_refinement {

/// left/image_rect, left/camera_info, right/image_rect, right/camera_info -> disparity.
class DisparityNodelet : public LazyNodelet {
 public:
  ~DisparityNodelet() override {
    // First whoever calls this object from another thread.
    stop();
    if (monitor_) monitor_->stop();
    if (subscriber_) subscriber_->unsubscribe();
    done_subscriber_.shutdown();
    worker_.reset();
    subscriber_.reset();
    monitor_.reset();
  }

 private:
  void onInit() override {
    ros::NodeHandle& nh = getNodeHandle();
    ros::NodeHandle& private_nh = getPrivateNodeHandle();
    monitor_ = std::make_unique<StageMonitor>(getName(), nh, private_nh);
    parameters_ = std::make_unique<LiveParameters<DisparityConfig>>(private_nh);
    const auto queue_size = startFrames(private_nh, "queue_size", 1);
    const auto max_frames = startFrames(private_nh, "max_frames_in_flight", 0, 0);
    flow_control_ = std::make_unique<FlowControl>(max_frames, cv::getNumThreads());
    worker_ = std::make_unique<FrameWorker<StereoFrame>>(
        queue_size, *monitor_, [this](const StereoFrame& frame) { process(frame); },
        [this] { return flow_control_->delay(ros::SteadyTime::now()); });
    subscriber_ = std::make_unique<StereoSubscriber>(
        nh, private_nh, queue_size, *monitor_, [this](const StereoFrame& frame) { worker_->push(frame); });
    publisher_ = advertise<stereo_msgs::DisparityImage>(nh, "disparity");
    parameters_publisher_ = nh.advertise<FrameParameters>("disparity_parameters", PUBLISHER_QUEUE_SIZE);
    monitor_->start();
    start();
  }

  void updateSubscriptions() override {
    const bool is_wanted = isWanted(publisher_);
    monitor_->setActive(is_wanted);
    if (!is_wanted) {
      subscriber_->unsubscribe();
      done_subscriber_.shutdown();
    } else {
      if (!done_subscriber_) {
        done_subscriber_ = getNodeHandle().subscribe<std_msgs::Header>(
            "refinement_done", INPUT_QUEUE_SIZE,
            [this](const std_msgs::Header::ConstPtr& done) {
              flow_control_->refined(done->stamp, ros::SteadyTime::now());
              worker_->wake();
            },
            {}, ros::TransportHints().tcpNoDelay());
      }
      subscriber_->subscribe();
    }
  }

  void process(const StereoFrame& frame) {
    const ros::SteadyTime begin = ros::SteadyTime::now();
    monitor_->traceReceived("left/image_rect", frame.left->header.stamp, frame.left->data.data());
    monitor_->traceReceived("right/image_rect", frame.right->header.stamp, frame.right->data.data());
    const auto snapshot = parameters_->snapshot();
    // Now, for whoever works for the frames that are matched alone.
    publishParameters(parameters_publisher_, frame.left->header, snapshot->message);
    if (snapshot != snapshot_) matcher_ = StereoMatcher(snapshot->parameters);
    snapshot_ = snapshot;
    warnAboutFrameIds(frame);

    const StereoGeometry geometry = geometryOf(frame);
    const auto left = grayImage(frame.left, subscriber_->leftImageTopic());
    const auto right = grayImage(frame.right, subscriber_->rightImageTopic());
    warnAboutSize(*frame.left_info, left->image.size());
    const DisparityRange range = matcher_.range(geometry.principal_point_offset);
    const cv::Size size = left->image.size();

    const auto message =
        makeDisparityImage(frame.left->header, size, geometry, range, matcher_.validWindow(size));
    cv::Mat disparity = imageView(message->image, sensor_msgs::image_encodings::TYPE_32FC1, "disparity");
    try {
      matcher_.compute(left->image, right->image, disparity, geometry.principal_point_offset);
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument(subscriber_->leftImageTopic() + ", " + subscriber_->rightImageTopic() +
                                  ": " + e.what());
    }
    const ros::SteadyTime end = ros::SteadyTime::now();
    const double seconds = (end - begin).toSec();
    monitor_->published(message->header.stamp, seconds * 1e3);
    monitor_->tracePublished("disparity", message->header.stamp, message->image.data.data());
    flow_control_->matched(message->header.stamp, seconds, end);
    publisher_.publish(message);
  }

  StereoGeometry geometryOf(const StereoFrame& frame) const {
    try {
      return stereoGeometry(*frame.left_info, *frame.right_info);
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument(subscriber_->leftInfoTopic() + ", " + subscriber_->rightInfoTopic() + ": " +
                                  e.what());
    }
  }

  /// Focal length and baseline are those of the calibrated size. Width and height may be left empty.
  void warnAboutSize(const sensor_msgs::CameraInfo& info, const cv::Size& size) {
    if (info.width == 0 || info.height == 0 || info.binning_x > 1 || info.roi.width > 0) return;
    if (static_cast<int>(info.width) == size.width && static_cast<int>(info.height) == size.height) return;
    monitor_->warning(subscriber_->leftInfoTopic() + " is that of " + std::to_string(info.width) + "x" +
                      std::to_string(info.height) + " px, but the image has " + std::to_string(size.width) +
                      "x" + std::to_string(size.height) +
                      " px: expected equal sizes, the depth will be wrong");
  }

  void warnAboutFrameIds(const StereoFrame& frame) {
    const std::string& left = frame.left_info->header.frame_id;
    const std::string& right = frame.right_info->header.frame_id;
    if (left == right || warned_about_frame_ids_) return;
    warned_about_frame_ids_ = true;
    monitor_->warning(subscriber_->leftInfoTopic() + " is in frame '" + left + "', " +
                      subscriber_->rightInfoTopic() + " in '" + right +
                      "', expected the left camera's frame in both: the left image's is used");
  }

  std::unique_ptr<StageMonitor> monitor_;
  std::unique_ptr<LiveParameters<DisparityConfig>> parameters_;
  std::shared_ptr<const LiveParameters<DisparityConfig>::Snapshot> snapshot_;  // Of the frame before.
  StereoMatcher matcher_;
  bool warned_about_frame_ids_ = false;
  ros::Publisher publisher_, parameters_publisher_;
  std::unique_ptr<StereoSubscriber> subscriber_;
  std::unique_ptr<FlowControl> flow_control_;
  ros::Subscriber done_subscriber_;
  std::unique_ptr<FrameWorker<StereoFrame>> worker_;
};

}  // namespace disparity_refinement

PLUGINLIB_EXPORT_CLASS(disparity_refinement::DisparityNodelet, nodelet::Nodelet)
