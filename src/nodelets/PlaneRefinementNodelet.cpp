#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <stereo_msgs/DisparityImage.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/refinement/Confidence.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/ros/FrameWorker.hpp"
#include "disparity_refinement/ros/ImageSubscriber.hpp"
#include "disparity_refinement/ros/LazyNodelet.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/OptionalJoin.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"
#include "disparity_refinement/ros/StampJoin.hpp"

namespace disparity_refinement {

/// disparity, labels, and with refinement_mode Quality left/image_rect -> disparity_refined, planes, depth,
/// disparity_source, confidence.
class PlaneRefinementNodelet : public LazyNodelet {
 public:
  ~PlaneRefinementNodelet() override {
    // First whoever calls this object from another thread.
    stop();
    patience_timer_.stop();
    disparity_subscriber_.shutdown();
    labels_subscriber_.shutdown();
    image_subscriber_.shutdown();
    worker_.reset();
    monitor_.reset();
  }

 private:
  using Disparity = stereo_msgs::DisparityImage;
  using Image = sensor_msgs::Image;
  struct Frame {
    Disparity::ConstPtr disparity;
    Image::ConstPtr labels;
    Image::ConstPtr image;  // Null unless there is one with the same stamp and it is needed.
  };

  void onInit() override {
    ros::NodeHandle& nh = getNodeHandle();
    ros::NodeHandle& private_nh = getPrivateNodeHandle();
    monitor_ = std::make_unique<StageMonitor>(getName(), nh, private_nh);
    parameters_ = std::make_unique<LiveParameters<PlaneRefinementConfig>>(private_nh, [this] { update(); });
    queue_size_ = std::max(1, private_nh.param("queue_size", 5));
    const auto cache_size = static_cast<std::size_t>(std::max(1, private_nh.param("cache_size", 30)));
    worker_ = std::make_unique<FrameWorker<Frame>>(queue_size_, *monitor_,
                                                   [this](const Frame& frame) { process(frame); });
    image_join_ = std::make_unique<OptionalJoin<Frame, Image>>(
        cache_size, [this](Frame frame, const Image::ConstPtr& image) {
          frame.image = image;
          worker_->push(std::move(frame));
        });
    join_ = std::make_unique<StampJoin<Disparity, Image>>(
        cache_size,
        [this](const Disparity::ConstPtr& disparity, const Image::ConstPtr& labels) {
          const Frame frame{disparity, labels, nullptr};
          image_join_->addFrame(disparity->header.stamp, frame);
          // Nothing to wait for.
          if (!is_image_needed_) image_join_->flush();
        },
        [this](int messages) { unmatched_ += messages; });
    monitor_->addDiagnostics([this](diagnostic_updater::DiagnosticStatusWrapper& status) {
      status.add("messages without a partner of the same stamp", unmatched_);
      status.add("frames refined without the left image", without_image_.load());
    });
    refined_publisher_ = advertise<Disparity>(nh, "disparity_refined");
    planes_publisher_ = advertise<Planes>(nh, "planes");
    depth_publisher_ = advertise<Image>(nh, "depth");
    source_publisher_ = advertise<Image>(nh, "disparity_source");
    confidence_publisher_ = advertise<Image>(nh, "confidence");
    const ros::WallDuration patience(0.25);
    patience_timer_ = private_nh.createWallTimer(
        patience, [this, patience](const ros::WallTimerEvent&) { image_join_->expire(patience); });
    monitor_->start();
    start();
  }

  void updateSubscriptions() override {
    bool is_wanted = false;
    for (const ros::Publisher* publisher : {&refined_publisher_, &planes_publisher_, &depth_publisher_,
                                            &source_publisher_, &confidence_publisher_}) {
      is_wanted = isWanted(*publisher) || is_wanted;
    }
    if (!is_wanted) {
      disparity_subscriber_.shutdown();
      labels_subscriber_.shutdown();
      join_->clear();
      unsubscribeImage();
      return;
    }
    if (parameters_->snapshot().mode == RefinementMode::PAPER) {
      unsubscribeImage();
    } else if (!image_subscriber_.isSubscribed()) {
      // Before the labels, which are made of it.
      subscribeImage();
    }
    if (!disparity_subscriber_) {
      ros::NodeHandle& nh = getNodeHandle();
      const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
      labels_subscriber_ = nh.subscribe<Image>(
          "labels", queue_size_, [this](const Image::ConstPtr& labels) { join_->addSecond(labels); }, {},
          hints);
      disparity_subscriber_ = nh.subscribe<Disparity>(
          "disparity", queue_size_,
          [this](const Disparity::ConstPtr& disparity) { join_->addFirst(disparity); }, {}, hints);
    }
  }

  void subscribeImage() {
    try {
      image_subscriber_.subscribe(getNodeHandle(), getPrivateNodeHandle(), "left/image_rect",
                                  static_cast<std::uint32_t>(queue_size_),
                                  [this](const Image::ConstPtr& image) { image_join_->addMessage(image); });
      is_image_needed_ = true;
    } catch (const std::exception& e) {
      monitor_->error("cannot subscribe to " + getNodeHandle().resolveName("left/image_rect") +
                      ", refining as in the paper: " + e.what());
    }
  }

  void unsubscribeImage() {
    is_image_needed_ = false;
    image_subscriber_.shutdown();
    image_join_->flush();
  }

  void process(const Frame& frame) {
    const ros::WallTime begin = ros::WallTime::now();
    RefinementParameters parameters = parameters_->snapshot();
    const Disparity& in = *frame.disparity;
    const ros::Time& stamp = in.header.stamp;
    monitor_->traceReceived("disparity", stamp, in.image.data.data());
    monitor_->traceReceived("labels", stamp, frame.labels->data.data());

    const std::string disparity_topic = getNodeHandle().resolveName("disparity");
    const std::string labels_topic = getNodeHandle().resolveName("labels");
    const cv::Mat disparity = imageView(in.image, sensor_msgs::image_encodings::TYPE_32FC1, disparity_topic);
    const cv::Mat labels = imageView(*frame.labels, sensor_msgs::image_encodings::TYPE_32SC1, labels_topic);
    const std::string image_topic = getNodeHandle().resolveName("left/image_rect");
    cv_bridge::CvImageConstPtr gray;
    if (parameters.mode == RefinementMode::QUALITY) {
      gray = grayOf(frame, disparity.size(), image_topic);
      if (!gray) {
        parameters.mode = RefinementMode::PAPER;
        ++without_image_;
      }
    }
    const StereoGeometry geometry = disparityGeometry(in, disparity_topic);
    const DisparityRange range = disparityRange(in, disparity_topic);

    const auto message =
        makeDisparityImage(in.header, disparity.size(), geometry, range, validWindow(in, disparity.size()));
    if (in.delta_d > 0.0F && std::isfinite(in.delta_d)) message->delta_d = in.delta_d;
    cv::Mat refined =
        imageView(message->image, sensor_msgs::image_encodings::TYPE_32FC1, "disparity_refined");
    try {
      refinement_.refine(disparity, labels, gray ? gray->image : cv::Mat(), range,
                         geometry.focal_length * geometry.baseline, parameters, refined);
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
    publishConfidence(in.header, disparity, refined, labels, range);
  }

  void publishConfidence(const std_msgs::Header& header, const cv::Mat& disparity, const cv::Mat& refined,
                         const cv::Mat& labels, const DisparityRange& range) {
    const bool with_confidence = confidence_publisher_.getNumSubscribers() > 0;
    if (!with_confidence && source_publisher_.getNumSubscribers() == 0) return;
    const auto makeMono = [&] {
      return makeImage(header, disparity.size(), sensor_msgs::image_encodings::MONO8);
    };
    const sensor_msgs::ImagePtr source_message = makeMono();
    cv::Mat sources =
        imageView(*source_message, sensor_msgs::image_encodings::MONO8, source_publisher_.getTopic());
    findSources(disparity, refined, labels, range, refinement_.fittedPlanes(), sources);
    source_publisher_.publish(source_message);
    if (!with_confidence) return;
    const sensor_msgs::ImagePtr message = makeMono();
    cv::Mat confidence =
        imageView(*message, sensor_msgs::image_encodings::MONO8, confidence_publisher_.getTopic());
    findConfidence(sources, confidence);
    confidence_publisher_.publish(message);
  }

  /// Null, with a warning or an error, where the refinement has to do without: a good frame is worth more
  /// than the best refinement.
  cv_bridge::CvImageConstPtr grayOf(const Frame& frame, const cv::Size& size, const std::string& topic) {
    if (!frame.image) {
      // When the mode or a listener has just changed, frames are under way without.
      if (without_image_ >= queue_size_) {
        monitor_->warning("no image on " + topic +
                          " with the stamp of the disparity map: refined as in the paper, expected the left "
                          "image for refinement_mode Quality");
      }
      return nullptr;
    }
    monitor_->traceReceived("left/image_rect", frame.image->header.stamp, frame.image->data.data());
    try {
      const cv_bridge::CvImageConstPtr gray = grayImage(frame.image, topic);
      requireImage(gray->image, topic.c_str(), CV_8UC1, size);
      return gray;
    } catch (const std::exception& e) {
      monitor_->error(std::string(e.what()) + "; refined as in the paper");
      return nullptr;
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
  DisparityRefinement refinement_;
  int queue_size_ = 5;
  std::atomic<bool> is_image_needed_{false};
  std::atomic<long> without_image_{0};  // Frames that needed one.
  long unmatched_ = 0;
  ros::Publisher refined_publisher_, planes_publisher_, depth_publisher_, source_publisher_,
      confidence_publisher_;
  std::unique_ptr<OptionalJoin<Frame, Image>> image_join_;
  std::unique_ptr<StampJoin<Disparity, Image>> join_;
  ros::Subscriber disparity_subscriber_, labels_subscriber_;
  ImageSubscriber image_subscriber_;
  ros::WallTimer patience_timer_;
  std::unique_ptr<FrameWorker<Frame>> worker_;
};

}  // namespace disparity_refinement

PLUGINLIB_EXPORT_CLASS(disparity_refinement::PlaneRefinementNodelet, nodelet::Nodelet)
