#include <image_transport/image_transport.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <stereo_msgs/DisparityImage.h>

#include <functional>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <string>

#include "disparity_refinement/ros/FrameWorker.hpp"
#include "disparity_refinement/ros/ImageSubscriber.hpp"
#include "disparity_refinement/ros/LazyNodelet.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"
#include "disparity_refinement/ros/StampJoin.hpp"
#include "disparity_refinement/visualization/Colorize.hpp"

namespace disparity_refinement {

/// disparity, disparity_refined, labels, left/image_rect -> pictures. Each is computed only while somebody
/// looks at it.
class VisualizationNodelet : public LazyNodelet {
 public:
  ~VisualizationNodelet() override {
    // First whoever calls this object from another thread.
    stop();
    disparity_subscriber_.shutdown();
    refined_subscriber_.shutdown();
    labels_subscriber_.shutdown();
    image_subscriber_.shutdown();
    worker_.reset();
    monitor_.reset();
  }

 private:
  using Disparity = stereo_msgs::DisparityImage;
  using Image = sensor_msgs::Image;
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
    constexpr std::size_t PICTURES = 4;
    worker_ =
        std::make_unique<FrameWorker<Picture>>(PICTURES, *monitor_, [](const Picture& draw) { draw(); });
    constexpr std::size_t CACHE_SIZE = 30;
    join_ = std::make_unique<StampJoin<Image, Image>>(
        CACHE_SIZE,
        [this](const Image::ConstPtr& image, const Image::ConstPtr& labels) {
          worker_->push([this, image, labels] { drawBorders(image, labels); });
        },
        [](const auto&) {});
    disparity_publisher_ = advertiseImage(*transport_, "disparity_color");
    refined_publisher_ = advertiseImage(*transport_, "disparity_refined_color");
    labels_publisher_ = advertiseImage(*transport_, "labels_color");
    borders_publisher_ = advertiseImage(*transport_, "segment_borders");
    monitor_->start();
    start();
  }

  void updateSubscriptions() override {
    const bool borders = borders_publisher_.getNumSubscribers() > 0;
    subscribeDisparity(disparity_publisher_, "disparity", disparity_subscriber_);
    subscribeDisparity(refined_publisher_, "disparity_refined", refined_subscriber_);

    if (!borders && labels_publisher_.getNumSubscribers() == 0) {
      labels_subscriber_.shutdown();
    } else if (!labels_subscriber_) {
      labels_subscriber_ =
          getNodeHandle().subscribe<Image>("labels", 1, [this](const Image::ConstPtr& labels) {
            if (labels_publisher_.getNumSubscribers() > 0)
              worker_->push([this, labels] { drawLabels(labels); });
            if (borders_publisher_.getNumSubscribers() > 0) join_->addSecond(labels);
          });
    }
    if (!borders) {
      image_subscriber_.shutdown();
      join_->clear();
    } else if (!image_subscriber_.isSubscribed()) {
      image_subscriber_.subscribe(getNodeHandle(), getPrivateNodeHandle(), "left/image_rect", 1, *monitor_,
                                  [this](const Image::ConstPtr& image) { join_->addFirst(image); });
    }
  }

  void subscribeDisparity(const image_transport::Publisher& publisher, const std::string& topic,
                          ros::Subscriber& subscriber) {
    if (publisher.getNumSubscribers() == 0) {
      subscriber.shutdown();
    } else if (!subscriber) {
      subscriber = getNodeHandle().subscribe<Disparity>(
          topic, 1, [this, &publisher, topic](const Disparity::ConstPtr& disparity) {
            worker_->push(
                [this, &publisher, topic, disparity] { drawDisparity(*disparity, topic, publisher); });
          });
    }
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

  void drawBorders(const Image::ConstPtr& image, const Image::ConstPtr& message) {
    monitor_->traceReceived("left/image_rect", image->header.stamp, image->data.data());
    monitor_->traceReceived("labels", message->header.stamp, message->data.data());
    const cv::Mat labels = labelView(*message);
    const auto gray = grayImage(image, getNodeHandle().resolveName("left/image_rect"));
    publish(image->header, labels.size(), borders_publisher_,
            [&](cv::Mat& picture) { drawSegmentBorders(gray->image, labels, picture); });
  }

  cv::Mat labelView(const Image& message) {
    return imageView(message, sensor_msgs::image_encodings::TYPE_32SC1,
                     getNodeHandle().resolveName("labels"));
  }

  template <class Draw>
  void publish(const std_msgs::Header& header, const cv::Size& size,
               const image_transport::Publisher& publisher, const Draw& draw) {
    const ros::WallTime begin = ros::WallTime::now();
    const auto message = makeImage(header, size, sensor_msgs::image_encodings::BGR8);
    cv::Mat picture = imageView(*message, sensor_msgs::image_encodings::BGR8, publisher.getTopic());
    draw(picture);
    monitor_->published(header.stamp, (ros::WallTime::now() - begin).toSec() * 1e3);
    publisher.publish(message);
  }

  std::unique_ptr<StageMonitor> monitor_;
  std::unique_ptr<LiveParameters<VisualizationConfig>> parameters_;
  std::unique_ptr<image_transport::ImageTransport> transport_;
  image_transport::Publisher disparity_publisher_, refined_publisher_, labels_publisher_, borders_publisher_;
  std::unique_ptr<StampJoin<Image, Image>> join_;
  ros::Subscriber disparity_subscriber_, refined_subscriber_, labels_subscriber_;
  ImageSubscriber image_subscriber_;
  std::unique_ptr<FrameWorker<Picture>> worker_;
};

}  // namespace disparity_refinement

PLUGINLIB_EXPORT_CLASS(disparity_refinement::VisualizationNodelet, nodelet::Nodelet)
