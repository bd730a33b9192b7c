#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <std_msgs/Header.h>
#include <stereo_msgs/DisparityImage.h>

#include <algorithm>
#include <atomic>
#include <boost/make_shared.hpp>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/refinement/Confidence.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/refinement/RefinementStatistics.hpp"
#include "disparity_refinement/ros/FrameWorker.hpp"
#include "disparity_refinement/ros/ImageSubscriber.hpp"
#include "disparity_refinement/ros/LazyNodelet.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/OptionalJoin.hpp"
#include "disparity_refinement/ros/PartnerWatch.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"
#include "disparity_refinement/ros/StampCache.hpp"
#include "disparity_refinement/ros/StampJoin.hpp"
#include "disparity_refinement/ros/StartParameters.hpp"

namespace disparity_refinement {

/// disparity, labels, and with refinement_mode Quality left/image_rect -> disparity_refined, planes,
/// disparity_source, confidence. Planes take disparity_parameters and segmentation_parameters along.
class PlaneRefinementNodelet : public LazyNodelet {
 public:
  ~PlaneRefinementNodelet() override {
    // First whoever calls this object from another thread.
    stop();
    if (monitor_) monitor_->stop();
    patience_timer_.stop();
    if (partner_watch_) partner_watch_->stop();
    disparity_subscriber_.shutdown();
    labels_subscriber_.shutdown();
    image_subscriber_.shutdown();
    unsubscribeParameters();
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
    const auto queue_size = startFrames(private_nh, "queue_size", 1);
    min_density_ = startParameter(private_nh, "diagnostics_min_density", 0.0, 0.0, 1.0);
    const auto cache_size = startFrames(private_nh, "cache_size", 30);
    worker_ = std::make_unique<FrameWorker<Frame>>(queue_size, *monitor_, [this](const Frame& frame) {
      // In whatever way it ends.
      const std::shared_ptr<void> announcement(nullptr, [&](void* /*unused*/) {
        done_publisher_.publish(boost::make_shared<std_msgs::Header>(frame.disparity->header));
      });
      process(frame);
    });
    image_join_ = std::make_unique<OptionalJoin<Frame, Image>>(
        cache_size, [this](Frame frame, const Image::ConstPtr& image) {
          frame.image = image;
          worker_->push(std::move(frame));
        });
    join_ = std::make_unique<StampJoin<Disparity, Image>>(
        cache_size,
        [this](const Disparity::ConstPtr& disparity, const Image::ConstPtr& labels) {
          partner_watch_->joined();
          const Frame frame{disparity, labels, nullptr};
          image_join_->addFrame(disparity->header.stamp, frame);
          // Nothing to wait for.
          if (!is_image_needed_) image_join_->flush();
        },
        [this](const StampJoin<Disparity, Image>::Counts& dropped) {
          const auto [disparities, labels] = dropped;
          monitor_->received(disparities);
          monitor_->dropped(DropReason::NO_PARTNER, disparities);
          labels_without_disparity_ += labels;
        });
    partner_watch_ = std::make_unique<PartnerWatch>(private_nh, *monitor_, nh.resolveName("disparity"),
                                                    nh.resolveName("labels"));
    disparity_parameters_ = std::make_unique<StampCache<FrameParameters>>(cache_size);
    segmentation_parameters_ = std::make_unique<StampCache<FrameParameters>>(cache_size);
    monitor_->addDiagnostics(
        [this](diagnostic_updater::DiagnosticStatusWrapper& status) { diagnose(status); });
    refined_publisher_ = advertise<Disparity>(nh, "disparity_refined");
    planes_publisher_ = advertise<Planes>(nh, "planes");
    source_publisher_ = advertise<Image>(nh, "disparity_source");
    confidence_publisher_ = advertise<Image>(nh, "confidence");
    done_publisher_ = nh.advertise<std_msgs::Header>("refinement_done", PUBLISHER_QUEUE_SIZE);
    const ros::WallDuration patience(0.25);
    patience_timer_ = private_nh.createSteadyTimer(
        ros::WallDuration(0.025),
        [this, patience](const ros::SteadyTimerEvent&) { image_join_->expire(patience); });
    monitor_->start();
    partner_watch_->start();
    start();
  }

  void updateSubscriptions() override {
    bool is_wanted = false;
    for (const ros::Publisher* publisher :
         {&refined_publisher_, &planes_publisher_, &source_publisher_, &confidence_publisher_}) {
      is_wanted = isWanted(*publisher) || is_wanted;
    }
    monitor_->setActive(is_wanted);
    if (!is_wanted) {
      disparity_subscriber_.shutdown();
      labels_subscriber_.shutdown();
      join_->clear();
      unsubscribeImage();
      unsubscribeParameters();
      return;
    }
    // Before the disparity and the labels, which they come ahead of.
    if (planes_publisher_.getNumSubscribers() == 0) {
      unsubscribeParameters();
    } else if (!disparity_parameters_subscriber_) {
      subscribeParameters();
    }
    if (parameters_->snapshot()->parameters.mode == RefinementMode::PAPER) {
      unsubscribeImage();
    } else if (!image_subscriber_.isSubscribed()) {
      // Before the labels, which are made of it.
      subscribeImage();
    }
    if (!disparity_subscriber_) {
      labels_subscriber_ = subscribe<Image>("labels", [this](const Image::ConstPtr& labels) {
        partner_watch_->receivedSecond();
        join_->addSecond(labels);
      });
      disparity_subscriber_ = subscribe<Disparity>("disparity", [this](const Disparity::ConstPtr& disparity) {
        partner_watch_->receivedFirst();
        join_->addFirst(disparity);
      });
    }
  }

  template <class Message, class Callback>
  ros::Subscriber subscribe(const std::string& topic, const Callback& callback) {
    return getNodeHandle().subscribe<Message>(topic, INPUT_QUEUE_SIZE, callback, {},
                                              ros::TransportHints().tcpNoDelay());
  }

  void subscribeParameters() {
    const auto subscribeCache = [this](const std::string& topic, StampCache<FrameParameters>& cache) {
      return subscribe<FrameParameters>(
          topic, [&cache](const FrameParameters::ConstPtr& parameters) { cache.add(parameters); });
    };
    disparity_parameters_subscriber_ = subscribeCache("disparity_parameters", *disparity_parameters_);
    segmentation_parameters_subscriber_ =
        subscribeCache("segmentation_parameters", *segmentation_parameters_);
  }

  void unsubscribeParameters() {
    disparity_parameters_subscriber_.shutdown();
    segmentation_parameters_subscriber_.shutdown();
  }

  void subscribeImage() {
    try {
      image_subscriber_.subscribe(getNodeHandle(), getPrivateNodeHandle(), "left/image_rect",
                                  INPUT_QUEUE_SIZE, *monitor_,
                                  [this](const Image::ConstPtr& image) { image_join_->addMessage(image); });
      is_image_needed_ = true;
      without_image_lately_ = 0;
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
    const ros::SteadyTime begin = ros::SteadyTime::now();
    const auto snapshot = parameters_->snapshot();
    if (snapshot != snapshot_) refinement_ = DisparityRefinement();
    snapshot_ = snapshot;
    const RefinementParameters* parameters = &snapshot->parameters;
    RefinementParameters without_image;
    const Disparity& in = *frame.disparity;
    const ros::Time& stamp = in.header.stamp;
    monitor_->traceReceived("disparity", stamp, in.image.data.data());
    monitor_->traceReceived("labels", stamp, frame.labels->data.data());

    const std::string disparity_topic = getNodeHandle().resolveName("disparity");
    const std::string labels_topic = getNodeHandle().resolveName("labels");
    requireTime(in.header, disparity_topic);
    const cv::Mat disparity = imageView(in.image, sensor_msgs::image_encodings::TYPE_32FC1, disparity_topic);
    const cv::Mat labels = imageView(*frame.labels, sensor_msgs::image_encodings::TYPE_32SC1, labels_topic);
    const std::string image_topic = getNodeHandle().resolveName("left/image_rect");
    cv_bridge::CvImageConstPtr gray;
    if (parameters->mode == RefinementMode::QUALITY) {
      gray = grayOf(frame, disparity.size(), image_topic);
      if (!gray) {
        without_image = *parameters;
        without_image.mode = RefinementMode::PAPER;
        parameters = &without_image;
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
    const double focal_length_times_baseline = geometry.focal_length * geometry.baseline;
    try {
      refinement_.refine(disparity, labels, gray ? gray->image : cv::Mat(), range,
                         focal_length_times_baseline, *parameters, refined);
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument(disparity_topic + ", " + labels_topic + ": " + e.what());
    }
    monitor_->published(stamp, (ros::SteadyTime::now() - begin).toSec() * 1e3);
    monitor_->tracePublished("disparity_refined", stamp, message->image.data.data());
    refined_publisher_.publish(message);
    if (planes_publisher_.getNumSubscribers() > 0) {
      publishPlanes(in.header, snapshot->message, parameters->mode);
    }
    publishConfidence(in.header, disparity, refined, labels, range);
    if (is_statistics_due_.exchange(false)) {
      const RefinementStatistics statistics =
          measureRefinement(disparity, refined, labels, range, focal_length_times_baseline, *parameters,
                            refinement_.fittedPlanes());
      const std::lock_guard<std::mutex> lock(statistics_mutex_);
      statistics_ = statistics;
    }
  }

  void publishPlanes(const std_msgs::Header& header, const dynamic_reconfigure::Config& parameters,
                     RefinementMode mode) {
    const PlanesPtr message = planesMessage(header, refinement_.planes());
    const auto copyOf = [&header](const StampCache<FrameParameters>& cache) {
      const FrameParameters::ConstPtr found = cache.find(header.stamp);
      return found ? found->parameters : dynamic_reconfigure::Config();
    };
    message->disparity_parameters = copyOf(*disparity_parameters_);
    message->segmentation_parameters = copyOf(*segmentation_parameters_);
    message->refinement_parameters = parameters;
    for (dynamic_reconfigure::IntParameter& parameter : message->refinement_parameters.ints) {
      if (parameter.name == "refinement_mode") parameter.value = static_cast<int>(mode);
    }
    planes_publisher_.publish(message);
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
    status.add("labels without a disparity map of their stamp", labels_without_disparity_);
    status.add("frames refined without the left image", without_image_.load());
    // Of one frame a second: they take as long as a step of the refinement.
    is_statistics_due_ = true;
    std::optional<RefinementStatistics> statistics;
    {
      const std::lock_guard<std::mutex> lock(statistics_mutex_);
      std::swap(statistics, statistics_);
    }
    if (!statistics) return;
    status.add("pixels valid before [%]", 100.0 * statistics->valid_before);
    status.add("pixels valid after [%]", 100.0 * statistics->valid_after);
    status.add("segments", statistics->segments);
    const auto addShare = [&](const char* reason, int segments) {
      status.add(std::string("segments refused [%], ") + reason,
                 100.0 * segments / std::max(1, statistics->segments));
    };
    addShare("condition 1, depth error", statistics->refused_by_depth_error);
    addShare("condition 2, too few points", statistics->too_few_points);
    addShare("condition 3, maximum number of iterations", statistics->max_iterations);
    addShare("condition 4, divergence", statistics->refused_by_divergence);
    addShare("no plane through their points", statistics->degenerate);
    if (statistics->valid_after < min_density_) {
      std::ostringstream text;
      text << 100.0 * statistics->valid_after << " % of the pixels have a disparity, expected at least "
           << 100.0 * min_density_ << " %";
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, text.str());
    }
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
      // When the mode or a listener has just changed, some frames are under way without.
      constexpr int UNDER_WAY = 5;
      if (++without_image_lately_ > UNDER_WAY) {
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
  std::shared_ptr<const LiveParameters<PlaneRefinementConfig>::Snapshot> snapshot_;  // Of the frame before.
  DisparityRefinement refinement_;
  double min_density_ = 0.0;
  std::atomic<bool> is_image_needed_{false};
  std::atomic<long> without_image_{0};         // Frames that needed one,
  std::atomic<long> without_image_lately_{0};  // and those since it was subscribed to.
  long labels_without_disparity_ = 0;
  std::atomic<bool> is_statistics_due_{true};
  std::mutex statistics_mutex_;
  std::optional<RefinementStatistics> statistics_;  // Until they are reported.
  std::unique_ptr<StampCache<FrameParameters>> disparity_parameters_, segmentation_parameters_;
  ros::Publisher refined_publisher_, planes_publisher_, source_publisher_, confidence_publisher_,
      done_publisher_;
  std::unique_ptr<OptionalJoin<Frame, Image>> image_join_;
  std::unique_ptr<StampJoin<Disparity, Image>> join_;
  ros::Subscriber disparity_subscriber_, labels_subscriber_, disparity_parameters_subscriber_,
      segmentation_parameters_subscriber_;
  ImageSubscriber image_subscriber_;
  ros::SteadyTimer patience_timer_;
  std::unique_ptr<PartnerWatch> partner_watch_;
  std::unique_ptr<FrameWorker<Frame>> worker_;
};

}  // namespace disparity_refinement

PLUGINLIB_EXPORT_CLASS(disparity_refinement::PlaneRefinementNodelet, nodelet::Nodelet)
