#include "disparity_refinement/ros/StereoSubscriber.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <sstream>
#include <utility>

#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/StartParameters.hpp"

namespace disparity_refinement {
namespace {

/// Left and right may run apart by a few messages, however few frames may wait for the stage.
constexpr std::size_t MIN_QUEUE_SIZE = 30;

/// In the order of InputIndex.
constexpr std::array<const char*, 4> NAMES = {"left/image_rect", "left/camera_info", "right/image_rect",
                                              "right/camera_info"};

}  // namespace

StereoSubscriber::StereoSubscriber(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                                   std::size_t queue_size, StageMonitor& monitor, Callback callback)
    : nh_(nh),
      private_nh_(private_nh),
      monitor_(monitor),
      callback_(std::move(callback)),
      approximate_(startParameter(private_nh, "approximate_sync", false)),
      max_interval_(startParameter(private_nh, "approximate_sync_max_interval", 0.01, 1e-6, 3600.0)),
      queue_size_(std::max(queue_size, MIN_QUEUE_SIZE)),
      warning_period_(startParameter(private_nh, "sync_warning_period", 5.0, 0.1, 3600.0)),
      join_(
          queue_size_, approximate_ ? max_interval_ : 0.0, [this](const StereoFrame& frame) { pair(frame); },
          [this](int images) { unpaired_ += images; }) {
  for (std::size_t i = 0; i < NAMES.size(); ++i) inputs_[i].topic = nh_.resolveName(NAMES[i]);

  monitor_.addDiagnostics([this](diagnostic_updater::DiagnosticStatusWrapper& status) { diagnose(status); });
  timer_ = nh_.createSteadyTimer(
      ros::WallDuration(warning_period_), [this](const ros::SteadyTimerEvent&) { checkForPairs(); }, false,
      false);
}

StereoSubscriber::~StereoSubscriber() { unsubscribe(); }

void StereoSubscriber::subscribe() {
  if (subscribed_) return;
  join_.clear();
  for (Input& input : inputs_) input.last = ros::Time();
  startAnew();
  subscribeImage(LEFT_IMAGE, left_, &StereoJoin::addLeft);
  subscribeImage(RIGHT_IMAGE, right_, &StereoJoin::addRight);
  left_info_ = subscribeInfo(LEFT_INFO, &StereoJoin::addLeftInfo);
  right_info_ = subscribeInfo(RIGHT_INFO, &StereoJoin::addRightInfo);
  timer_.start();
  subscribed_ = true;
}

void StereoSubscriber::subscribeImage(InputIndex index, ImageSubscriber& subscriber,
                                      void (StereoJoin::*add)(const sensor_msgs::ImageConstPtr&)) {
  subscriber.subscribe(nh_, private_nh_, NAMES[index], static_cast<std::uint32_t>(queue_size_), monitor_,
                       [this, index, add](const sensor_msgs::ImageConstPtr& image) {
                         note(index, image->header.stamp);
                         (join_.*add)(image);
                       });
}

ros::Subscriber StereoSubscriber::subscribeInfo(
    InputIndex index, void (StereoJoin::*add)(const sensor_msgs::CameraInfoConstPtr&)) {
  return nh_.subscribe<sensor_msgs::CameraInfo>(
      NAMES[index], static_cast<std::uint32_t>(queue_size_),
      [this, index, add](const sensor_msgs::CameraInfoConstPtr& info) {
        try {
          requireTime(info->header, inputs_[index].topic);
        } catch (const std::exception& e) {
          monitor_.error(e.what());
          return;
        }
        note(index, info->header.stamp);
        (join_.*add)(info);
      });
}

void StereoSubscriber::unsubscribe() {
  subscribed_ = false;
  timer_.stop();
  problem_.clear();
  left_.shutdown();
  right_.shutdown();
  left_info_.shutdown();
  right_info_.shutdown();
}

void StereoSubscriber::note(InputIndex index, const ros::Time& stamp) {
  const auto narrow = [](double& smallest, double seconds) {
    if (smallest == UNKNOWN || seconds < smallest) smallest = seconds;
  };
  Input& input = inputs_[index];
  if (index == LEFT_IMAGE && !input.last.isZero() && stamp > input.last) {
    const double gap = (stamp - input.last).toSec();
    narrow(period_, gap);
    if (approximate_ && gap <= max_interval_) {
      monitor_.warning("images on " + input.topic +
                       " follow each other within ~approximate_sync_max_interval (" +
                       std::to_string(max_interval_) +
                       " s): set it below their distance, or images of different " + "frames may be paired");
    }
  }
  ++input.total;
  ++input.received;
  input.last = stamp;
  for (Offset& offset : offsets_) {
    if (index != offset.first && index != offset.second) continue;
    const ros::Time& other = inputs_[index == offset.first ? offset.second : offset.first].last;
    if (!other.isZero()) narrow(offset.smallest, std::abs((stamp - other).toSec()));
  }
}

void StereoSubscriber::startAnew() {
  for (Input& input : inputs_) input.received = 0;
  for (Offset& offset : offsets_) offset.smallest = UNKNOWN;
  period_ = UNKNOWN;
}

void StereoSubscriber::pair(const StereoFrame& frame) {
  ++pairs_;
  last_offset_ = (frame.left->header.stamp - frame.right->header.stamp).toSec();
  startAnew();
  problem_.clear();
  callback_(frame);
}

void StereoSubscriber::checkForPairs() {
  const bool any =
      std::any_of(inputs_.begin(), inputs_.end(), [](const Input& input) { return input.received > 0; });
  if (pairs_ == pairs_at_last_check_ && any) {
    std::ostringstream text;
    text << "no synchronized stereo pair for " << warning_period_ << " s; messages:";
    for (const Input& input : inputs_) {
      text << " " << input.topic << " " << input.received;
      if (!input.last.isZero()) text << " (last stamp " << input.last << ")";
      if (&input != &inputs_.back()) text << ",";
    }
    problem_ = text.str() + advice();
    monitor_.warning(problem_);
    startAnew();
  }
  pairs_at_last_check_ = pairs_;
}

std::string StereoSubscriber::advice() const {
  if (std::any_of(inputs_.begin(), inputs_.end(), [](const Input& input) { return input.received == 0; })) {
    return "; a topic without messages: does its camera run? check the names and remaps";
  }
  const Offset& widest =
      *std::max_element(offsets_.begin(), offsets_.end(),
                        [](const Offset& a, const Offset& b) { return a.smallest < b.smallest; });
  if (widest.smallest == UNKNOWN) return "";
  std::ostringstream text;
  text << "; the stamps of " << inputs_[widest.first].topic << " and " << inputs_[widest.second].topic
       << " differ by at least " << widest.smallest << " s";
  const bool is_far = period_ != UNKNOWN && widest.smallest > period_ / 4.0;
  if (is_far) text << ", the images follow each other in " << period_ << " s";
  text << ": ";
  if (widest.first != LEFT_IMAGE) {
    text << "let the driver give a camera_info the stamp of its image";
  } else if (is_far && widest.smallest > period_) {
    text << "synchronize the clocks that stamp the images, or set ~queue_size above the number of images by "
            "which one "
            "camera lags behind";
  } else if (is_far) {
    text << "trigger both cameras at the same time";
  } else if (approximate_) {
    text << "set ~approximate_sync_max_interval (" << max_interval_ << " s) above it";
  } else {
    text << "set ~approximate_sync to true and ~approximate_sync_max_interval above it";
  }
  return text.str();
}

void StereoSubscriber::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  if (!problem_.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, problem_);
  status.add("synchronization", approximate_ ? "approximate" : "exact");
  for (const Input& input : inputs_) status.add("messages on " + input.topic, input.total);
  status.add("pairs", pairs_);
  if (pairs_ > 0) status.add("left minus right stamp of the last pair [ms]", 1e3 * last_offset_);
  for (const Offset& offset : offsets_) {
    if (offset.smallest == UNKNOWN) continue;
    status.add("least distance since then of " + inputs_[offset.first].topic + " and " +
                   inputs_[offset.second].topic + " [ms]",
               1e3 * offset.smallest);
  }
  status.add("images without a partner", unpaired_);
}

}  // namespace disparity_refinement
