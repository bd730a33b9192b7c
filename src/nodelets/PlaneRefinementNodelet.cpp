#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <stereo_msgs/DisparityImage.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <stdexcept>
#include <utility>

#include "disparity_refinement/refinement/PlaneRefinement.hpp"
#include "disparity_refinement/ros/FrameWorker.hpp"
#include "disparity_refinement/ros/LazyNodelet.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"
#include "disparity_refinement/ros/StampJoin.hpp"

namespace disparity_refinement {

/// disparity, labels -> disparity_refined, planes, depth.
class PlaneRefinementNodelet : public LazyNodelet {
 public:
  ~PlaneRefinementNodelet() override {
    // First whoever calls this object from another thread.
    stop();
    disparity_subscriber_.shutdown();
    labels_subscriber_.shutdown();
    worker_.reset();
    monitor_.reset();
  }

 private:
  using Disparity = stereo_msgs::DisparityImage;
  using Labels = sensor_msgs::Image;
  struct Frame {
    Disparity::ConstPtr disparity;
    Labels::ConstPtr labels;
  };

  void onInit() override {
    ros::NodeHandle& nh = getNodeHandle();
    ros::NodeHandle& private_nh = getPrivateNodeHandle();
    monitor_ = std::make_unique<StageMonitor>(getName(), nh, private_nh);
    parameters_ = std::make_unique<LiveParameters<PlaneRefinementConfig>>(private_nh);
    queue_size_ = std::max(1, private_nh.param("queue_size", 5));
    const auto cache_size = static_cast<std::size_t>(std::max(1, private_nh.param("cache_size", 30)));
    worker_ = std::make_unique<FrameWorker<Frame>>(queue_size_, *monitor_,
                                                   [this](const Frame& frame) { process(frame); });
    join_ = std::make_unique<StampJoin<Disparity, Labels>>(
        cache_size,
        [this](const Disparity::ConstPtr& disparity, const Labels::ConstPtr& labels) {
          worker_->push({disparity, labels});
        },
        [this](int messages) { unmatched_ += messages; });
    monitor_->addDiagnostics([this](diagnostic_updater::DiagnosticStatusWrapper& status) {
      status.add("messages without a partner of the same stamp", unmatched_);
    });
    refined_publisher_ = advertise<Disparity>(nh, "disparity_refined");
    planes_publisher_ = advertise<Planes>(nh, "planes");
    depth_publisher_ = advertise<sensor_msgs::Image>(nh, "depth");
    monitor_->start();
    start();
  }

  void updateSubscriptions() override {
    if (!isWanted(refined_publisher_) && !isWanted(planes_publisher_) && !isWanted(depth_publisher_)) {
      disparity_subscriber_.shutdown();
      labels_subscriber_.shutdown();
      join_->clear();
    } else if (!disparity_subscriber_) {
      ros::NodeHandle& nh = getNodeHandle();
      const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
      labels_subscriber_ = nh.subscribe<Labels>(
          "labels", queue_size_, [this](const Labels::ConstPtr& labels) { join_->addSecond(labels); }, {},
          hints);
      disparity_subscriber_ = nh.subscribe<Disparity>(
          "disparity", queue_size_,
          [this](const Disparity::ConstPtr& disparity) { join_->addFirst(disparity); }, {}, hints);
    }
  }

  void process(const Frame& frame) {
    const ros::WallTime begin = ros::WallTime::now();
    const PlaneRefinementParameters parameters = parameters_->snapshot();
    const Disparity& in = *frame.disparity;
    const ros::Time& stamp = in.header.stamp;
    monitor_->traceReceived("disparity", stamp, in.image.data.data());
    monitor_->traceReceived("labels", stamp, frame.labels->data.data());

    const std::string disparity_topic = getNodeHandle().resolveName("disparity");
    const std::string labels_topic = getNodeHandle().resolveName("labels");
    const cv::Mat disparity = imageView(in.image, sensor_msgs::image_encodings::TYPE_32FC1, disparity_topic);
    const cv::Mat labels = imageView(*frame.labels, sensor_msgs::image_encodings::TYPE_32SC1, labels_topic);
    const StereoGeometry geometry = disparityGeometry(in, disparity_topic);
    const DisparityRange range = disparityRange(in, disparity_topic);

    const auto message =
        makeDisparityImage(in.header, disparity.size(), geometry, range, validWindow(in, disparity.size()));
    if (in.delta_d > 0.0F && std::isfinite(in.delta_d)) message->delta_d = in.delta_d;
    cv::Mat refined =
        imageView(message->image, sensor_msgs::image_encodings::TYPE_32FC1, "disparity_refined");
    try {
      refinement_.refine(disparity, labels, range, geometry.focal_length * geometry.baseline, parameters,
                         refined);
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument(disparity_topic + ", " + labels_topic + ": " + e.what());
    }
    monitor_->published(stamp, (ros::WallTime::now() - begin).toSec() * 1e3);
    monitor_->tracePublished("disparity_refined", stamp, message->image.data.data());
    refined_publisher_.publish(message);
    if (planes_publisher_.getNumSubscribers() > 0) {
      planes_publisher_.publish(planesMessage(in.header, refinement_.planes()));
    }
    if (depth_publisher_.getNumSubscribers() > 0) {
      depth_publisher_.publish(depthImage(in.header, refined, range, geometry));
    }
  }

  /// The window of a foreign publisher, cut to the image; the whole image if nothing is left.
  static cv::Rect validWindow(const Disparity& message, const cv::Size& size) {
    const auto& roi = message.valid_window;
    const cv::Rect image({0, 0}, size);
    // A stock window may have wrapped around to almost 2^32.
    const bool is_inside = roi.x_offset < message.image.width && roi.y_offset < message.image.height &&
                           roi.width <= message.image.width - roi.x_offset &&
                           roi.height <= message.image.height - roi.y_offset && roi.width > 0 &&
                           roi.height > 0;
    if (!is_inside) return image;
    return {static_cast<int>(roi.x_offset), static_cast<int>(roi.y_offset), static_cast<int>(roi.width),
            static_cast<int>(roi.height)};
  }

  std::unique_ptr<StageMonitor> monitor_;
  std::unique_ptr<LiveParameters<PlaneRefinementConfig>> parameters_;
  PlaneRefinement refinement_;
  int queue_size_ = 5;
  long unmatched_ = 0;
  ros::Publisher refined_publisher_, planes_publisher_, depth_publisher_;
  std::unique_ptr<StampJoin<Disparity, Labels>> join_;
  ros::Subscriber disparity_subscriber_, labels_subscriber_;
  std::unique_ptr<FrameWorker<Frame>> worker_;
};

}  // namespace disparity_refinement

PLUGINLIB_EXPORT_CLASS(disparity_refinement::PlaneRefinementNodelet, nodelet::Nodelet)
