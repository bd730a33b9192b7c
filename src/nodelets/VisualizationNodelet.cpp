#include <image_transport/image_transport.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <stereo_msgs/DisparityImage.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "disparity_refinement/Planes.h"
#include "disparity_refinement/ros/FrameWorker.hpp"
#include "disparity_refinement/ros/ImageSubscriber.hpp"
#include "disparity_refinement/ros/LazyNodelet.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/PlaneMarkers.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"
#include "disparity_refinement/ros/StampJoin.hpp"
#include "disparity_refinement/ros/StartParameters.hpp"
#include "disparity_refinement/ros/StereoGeometry.hpp"
#include "disparity_refinement/visualization/Colorize.hpp"
#include "disparity_refinement/visualization/PlanePatches.hpp"

namespace disparity_refinement {

/// disparity, disparity_refined, labels, planes, left/image_rect, left/camera_info -> pictures and markers.
/// Each is computed only while somebody looks at it.
class VisualizationNodelet : public LazyNodelet {
 public:
  ~VisualizationNodelet() override {
    // First whoever calls this object from another thread.
    stop();
    if (monitor_) monitor_->stop();
    disparity_subscriber_.shutdown();
    refined_subscriber_.shutdown();
    labels_subscriber_.shutdown();
    planes_subscriber_.shutdown();
    info_subscriber_.shutdown();
    image_subscriber_.shutdown();
    worker_.reset();
    monitor_.reset();
  }

 private:
  using CameraInfo = sensor_msgs::CameraInfo;
  using Disparity = stereo_msgs::DisparityImage;
  using Image = sensor_msgs::Image;
  using MarkerArray = visualization_msgs::MarkerArray;
  using Picture = std::function<void()>;

  void onInit() override {
    ros::NodeHandle& nh = getNodeHandle();
    ros::NodeHandle& private_nh = getPrivateNodeHandle();
    monitor_ = std::make_unique<StageMonitor>(getName(), nh, private_nh);
    parameters_ = std::make_unique<LiveParameters<VisualizationConfig>>(private_nh);
    {
      const std::lock_guard<std::mutex> lock(imageTransportMutex());
      transport_ = std::make_unique<image_transport::ImageTransport>(nh);
    }
    constexpr std::size_t PICTURES = 6;
    worker_ =
        std::make_unique<FrameWorker<Picture>>(PICTURES, *monitor_, [](const Picture& draw) { draw(); });
    const auto cache_size = startFrames(private_nh, "cache_size", 30);
    const auto ignore = [](const auto&) {};
    borders_join_ = std::make_unique<StampJoin<Image, Image>>(
        cache_size,
        [this](const Image::ConstPtr& labels, const Image::ConstPtr& image) {
          worker_->push([this, labels, image] { drawBorders(labels, image); });
        },
        ignore);
    refused_join_ = std::make_unique<StampJoin<Image, Image, Planes>>(
        cache_size,
        [this](const Image::ConstPtr& labels, const Image::ConstPtr& image, const Planes::ConstPtr& planes) {
          worker_->push([this, labels, image, planes] { drawRefused(labels, image, *planes); });
        },
        ignore);
    markers_join_ = std::make_unique<StampJoin<Image, Disparity, Planes>>(
        cache_size,
        [this](const Image::ConstPtr& labels, const Disparity::ConstPtr& refined,
               const Planes::ConstPtr& planes) {
          // The camera's calibration does not change from frame to frame: the newest will do.
          worker_->push([this, labels, refined, planes, info = info_] {
            drawMarkers(*labels, *refined, *planes, info);
          });
        },
        ignore);
    disparity_publisher_ = advertiseImage(*transport_, "disparity_color");
    refined_publisher_ = advertiseImage(*transport_, "disparity_refined_color");
    labels_publisher_ = advertiseImage(*transport_, "labels_color");
    borders_publisher_ = advertiseImage(*transport_, "segment_borders");
    refused_publisher_ = advertiseImage(*transport_, "refused_segments");
    markers_publisher_ = advertise<MarkerArray>(nh, "plane_markers");
    monitor_->start();
    start();
  }

  void updateSubscriptions() override {
    const bool borders = isHeard(borders_publisher_), refused = isHeard(refused_publisher_),
               markers = isHeard(markers_publisher_);
    monitor_->setActive(borders || refused || markers || isHeard(disparity_publisher_) ||
                        isHeard(refined_publisher_) || isHeard(labels_publisher_));
    if (!borders) borders_join_->clear();
    if (!refused) refused_join_->clear();
    if (!markers) markers_join_->clear();

    // First: planes do not wait for it.
    subscribeWhile(markers, "left/camera_info", info_subscriber_, &VisualizationNodelet::receiveInfo);
    subscribeWhile(isHeard(disparity_publisher_), "disparity", disparity_subscriber_,
                   &VisualizationNodelet::receiveDisparity);
    subscribeWhile(isHeard(refined_publisher_) || markers, "disparity_refined", refined_subscriber_,
                   &VisualizationNodelet::receiveRefined);
    subscribeWhile(isHeard(labels_publisher_) || borders || refused || markers, "labels", labels_subscriber_,
                   &VisualizationNodelet::receiveLabels);
    subscribeWhile(refused || markers, "planes", planes_subscriber_, &VisualizationNodelet::receivePlanes);
    if (!borders && !refused) {
      image_subscriber_.shutdown();
    } else if (!image_subscriber_.isSubscribed()) {
      image_subscriber_.subscribe(getNodeHandle(), getPrivateNodeHandle(), "left/image_rect",
                                  INPUT_QUEUE_SIZE, *monitor_,
                                  [this](const Image::ConstPtr& image) { receiveImage(image); });
    }
  }

  /// Whatever ~lazy says: pictures are for somebody who looks at them.
  template <class Publisher>
  static bool isHeard(const Publisher& publisher) {
    return publisher.getNumSubscribers() > 0;
  }

  template <class Message>
  void subscribeWhile(bool is_wanted, const std::string& topic, ros::Subscriber& subscriber,
                      void (VisualizationNodelet::*receive)(const boost::shared_ptr<const Message>&)) {
    if (!is_wanted) {
      subscriber.shutdown();
    } else if (!subscriber) {
      subscriber = getNodeHandle().subscribe(topic, INPUT_QUEUE_SIZE, receive, this);
    }
  }

  void receiveInfo(const CameraInfo::ConstPtr& info) { info_ = info; }

  void receiveDisparity(const Disparity::ConstPtr& disparity) {
    worker_->push([this, disparity] { drawDisparity(*disparity, "disparity", disparity_publisher_); });
  }

  void receiveRefined(const Disparity::ConstPtr& refined) {
    if (isHeard(refined_publisher_)) {
      worker_->push([this, refined] { drawDisparity(*refined, "disparity_refined", refined_publisher_); });
    }
    if (isHeard(markers_publisher_)) markers_join_->add<1>(refined);
  }

  void receiveLabels(const Image::ConstPtr& labels) {
    if (isHeard(labels_publisher_)) worker_->push([this, labels] { drawLabels(labels); });
    if (isHeard(borders_publisher_)) borders_join_->add<0>(labels);
    if (isHeard(refused_publisher_)) refused_join_->add<0>(labels);
    if (isHeard(markers_publisher_)) markers_join_->add<0>(labels);
  }

  void receiveImage(const Image::ConstPtr& image) {
    if (isHeard(borders_publisher_)) borders_join_->add<1>(image);
    if (isHeard(refused_publisher_)) refused_join_->add<1>(image);
  }

  void receivePlanes(const Planes::ConstPtr& planes) {
    if (isHeard(refused_publisher_)) refused_join_->add<2>(planes);
    if (isHeard(markers_publisher_)) markers_join_->add<2>(planes);
  }

  void drawDisparity(const Disparity& message, const std::string& topic,
                     const image_transport::Publisher& publisher) {
    const VisualizationConfig parameters = parameters_->snapshot()->parameters;
    const std::string name = getNodeHandle().resolveName(topic);
    monitor_->traceReceived(topic, message.header.stamp, message.image.data.data());
    const cv::Mat disparity = imageView(message.image, sensor_msgs::image_encodings::TYPE_32FC1, name);
    publish(message.header, disparity.size(), publisher, [&](cv::Mat& picture) {
      colorizeDisparity(disparity, disparityRange(message, name),
                        static_cast<float>(parameters.color_min_disparity),
                        static_cast<float>(parameters.color_max_disparity), picture);
    });
  }

  void drawLabels(const Image::ConstPtr& message) {
    const cv::Mat labels = labelView(*message);
    publish(message->header, labels.size(), labels_publisher_,
            [&](cv::Mat& picture) { colorizeLabels(labels, picture); });
  }

  void drawBorders(const Image::ConstPtr& message, const Image::ConstPtr& image) {
    monitor_->traceReceived("left/image_rect", image->header.stamp, image->data.data());
    monitor_->traceReceived("labels", message->header.stamp, message->data.data());
    const cv::Mat labels = labelView(*message);
    const auto gray = grayImage(image, getNodeHandle().resolveName("left/image_rect"));
    publish(image->header, labels.size(), borders_publisher_,
            [&](cv::Mat& picture) { drawSegmentBorders(gray->image, labels, picture); });
  }

  void drawRefused(const Image::ConstPtr& message, const Image::ConstPtr& image, const Planes& planes) {
    const cv::Mat labels = labelView(*message);
    const auto gray = grayImage(image, getNodeHandle().resolveName("left/image_rect"));
    const auto segments = segmentPlanes(planes, getNodeHandle().resolveName("planes"));
    publish(image->header, labels.size(), refused_publisher_, [&](cv::Mat& picture) {
      nameTopics({"left/image_rect", "labels", "planes"},
                 [&] { drawRefusedSegments(gray->image, labels, segments, picture); });
    });
  }

  void drawMarkers(const Image& message, const Disparity& refined, const Planes& planes,
                   const CameraInfo::ConstPtr& info) {
    const ros::SteadyTime begin = ros::SteadyTime::now();
    const std::string info_topic = getNodeHandle().resolveName("left/camera_info");
    if (!info) {
      // When a listener has just come, the first frame may be under way without.
      if (++frames_without_info_ > 1) {
        monitor_->warning("no message on " + info_topic + ": no " + markers_publisher_.getTopic() +
                          ", expected the principal point of the left image");
      }
      return;
    }
    const ProjectionMatrix p = projectionMatrix(*info);
    if (!std::isfinite(p[2]) || !std::isfinite(p[6])) {
      throw std::invalid_argument(info_topic + ": the principal point P[2], P[6] is " + std::to_string(p[2]) +
                                  ", " + std::to_string(p[6]) + ", expected finite values");
    }
    const cv::Mat labels = labelView(message);
    const auto segments = segmentPlanes(planes, getNodeHandle().resolveName("planes"));
    const StereoGeometry geometry =
        disparityGeometry(refined, getNodeHandle().resolveName("disparity_refined"));
    std::vector<PlanePatch> patches;
    nameTopics({"labels", "planes"}, [&] {
      patches = findPlanePatches(labels, segments, geometry, {p[2], p[6]});
    });
    const auto markers = planeMarkers(message.header, patches);
    monitor_->published(message.header.stamp, (ros::SteadyTime::now() - begin).toSec() * 1e3);
    markers_publisher_.publish(markers);
  }

  /// What the core refuses, with the names of the topics it came from.
  template <class Compute>
  void nameTopics(const std::vector<std::string>& topics, const Compute& compute) {
    try {
      compute();
    } catch (const std::invalid_argument& e) {
      std::string names;
      for (const std::string& topic : topics) {
        names += (names.empty() ? "" : ", ") + getNodeHandle().resolveName(topic);
      }
      throw std::invalid_argument(names + ": " + e.what());
    }
  }

  cv::Mat labelView(const Image& message) {
    return imageView(message, sensor_msgs::image_encodings::TYPE_32SC1,
                     getNodeHandle().resolveName("labels"));
  }

  template <class Draw>
  void publish(const std_msgs::Header& header, const cv::Size& size,
               const image_transport::Publisher& publisher, const Draw& draw) {
    const ros::SteadyTime begin = ros::SteadyTime::now();
    const auto message = makeImage(header, size, sensor_msgs::image_encodings::BGR8);
    cv::Mat picture = imageView(*message, sensor_msgs::image_encodings::BGR8, publisher.getTopic());
    draw(picture);
    monitor_->published(header.stamp, (ros::SteadyTime::now() - begin).toSec() * 1e3);
    publisher.publish(message);
  }

  std::unique_ptr<StageMonitor> monitor_;
  std::unique_ptr<LiveParameters<VisualizationConfig>> parameters_;
  std::unique_ptr<image_transport::ImageTransport> transport_;
  image_transport::Publisher disparity_publisher_, refined_publisher_, labels_publisher_, borders_publisher_,
      refused_publisher_;
  ros::Publisher markers_publisher_;
  std::unique_ptr<StampJoin<Image, Image>> borders_join_;              // labels, image
  std::unique_ptr<StampJoin<Image, Image, Planes>> refused_join_;      // labels, image, planes
  std::unique_ptr<StampJoin<Image, Disparity, Planes>> markers_join_;  // labels, refined disparity, planes
  CameraInfo::ConstPtr info_;                                          // The newest, null if none came.
  int frames_without_info_ = 0;
  ros::Subscriber disparity_subscriber_, refined_subscriber_, labels_subscriber_, planes_subscriber_,
      info_subscriber_;
  ImageSubscriber image_subscriber_;
  std::unique_ptr<FrameWorker<Picture>> worker_;
};

}  // namespace disparity_refinement

PLUGINLIB_EXPORT_CLASS(disparity_refinement::VisualizationNodelet, nodelet::Nodelet)
