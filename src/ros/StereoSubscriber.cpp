#include "disparity_refinement/ros/StereoSubscriber.hpp"

#include <message_filters/sync_policies/approximate_time.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <type_traits>
#include <utility>

namespace disparity_refinement {
namespace {

using sensor_msgs::CameraInfo;
using sensor_msgs::Image;
using ExactPolicy = message_filters::sync_policies::ExactTime<Image, CameraInfo, Image, CameraInfo>;
using ApproximatePolicy =
    message_filters::sync_policies::ApproximateTime<Image, CameraInfo, Image, CameraInfo>;

/// Left and right may run apart by a few messages, however few frames may wait for the stage.
constexpr int MIN_QUEUE_SIZE = 30;

}  // namespace

StereoSubscriber::StereoSubscriber(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                                   StageMonitor& monitor, Callback callback)
    : nh_(nh), private_nh_(private_nh), monitor_(monitor), callback_(std::move(callback)) {
  approximate_ = private_nh_.param("approximate_sync", false);
  max_interval_ = std::max(1e-6, private_nh_.param("approximate_sync_max_interval", 0.01));
  queue_size_ = std::max(1, private_nh_.param("queue_size", 1));
  warning_period_ = std::max(0.1, private_nh_.param("sync_warning_period", 5.0));

  inputs_[LEFT_IMAGE].topic = nh_.resolveName("left/image_rect");
  inputs_[LEFT_INFO].topic = nh_.resolveName("left/camera_info");
  inputs_[RIGHT_IMAGE].topic = nh_.resolveName("right/image_rect");
  inputs_[RIGHT_INFO].topic = nh_.resolveName("right/camera_info");

  monitor_.addDiagnostics([this](diagnostic_updater::DiagnosticStatusWrapper& status) { diagnose(status); });
  timer_ = nh_.createWallTimer(
      ros::WallDuration(warning_period_), [this](const ros::WallTimerEvent&) { checkForPairs(); }, false,
      false);
}

std::unique_ptr<StereoSubscriber::Synchronizer> StereoSubscriber::makeSynchronizer() {
  const auto queue_size = static_cast<std::uint32_t>(std::max(MIN_QUEUE_SIZE, queue_size_));
  auto result = std::make_unique<Synchronizer>();
  const auto connect = [this, &result](const auto& policy) {
    using Policy = std::decay_t<decltype(policy)>;
    const auto synchronizer = std::make_shared<message_filters::Synchronizer<Policy>>(
        policy, result->left, result->left_info, result->right, result->right_info);
    synchronizer->registerCallback(&StereoSubscriber::pair, this);
    result->policy = synchronizer;
  };
  if (approximate_) {
    ApproximatePolicy policy(queue_size);
    policy.setInterMessageLowerBound(ros::Duration(max_interval_));
    connect(policy);
  } else {
    connect(ExactPolicy(queue_size));
  }
  return result;
}

StereoSubscriber::~StereoSubscriber() { unsubscribe(); }

void StereoSubscriber::subscribe() {
  if (subscribed_) return;
  current_ = makeSynchronizer();
  previous_.reset();
  for (Input& input : inputs_) {
    input.last = ros::Time();
    input.received = 0;
    input.settling = false;
  }
  smallest_offset_ = -1.0;

  const auto queue_size = static_cast<std::uint32_t>(std::max(MIN_QUEUE_SIZE, queue_size_));
  left_.subscribe(nh_, private_nh_, "left/image_rect", queue_size,
                  [this](const sensor_msgs::ImageConstPtr& message) {
                    receive(LEFT_IMAGE, message, &Synchronizer::left);
                  });
  right_.subscribe(nh_, private_nh_, "right/image_rect", queue_size,
                   [this](const sensor_msgs::ImageConstPtr& message) {
                     receive(RIGHT_IMAGE, message, &Synchronizer::right);
                   });
  left_info_ = nh_.subscribe<CameraInfo>("left/camera_info", queue_size,
                                         [this](const sensor_msgs::CameraInfoConstPtr& message) {
                                           receive(LEFT_INFO, message, &Synchronizer::left_info);
                                         });
  right_info_ = nh_.subscribe<CameraInfo>("right/camera_info", queue_size,
                                          [this](const sensor_msgs::CameraInfoConstPtr& message) {
                                            receive(RIGHT_INFO, message, &Synchronizer::right_info);
                                          });
  timer_.start();
  subscribed_ = true;
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

template <class Message>
void StereoSubscriber::receive(InputIndex index, const boost::shared_ptr<const Message>& message,
                               message_filters::PassThrough<Message> Synchronizer::*input) {
  const ros::Time& stamp = message->header.stamp;
  ++inputs_[index].total;
  ++inputs_[index].received;
  Synchronizer& synchronizer = synchronizerFor(index, stamp);
  measureOffset(index, stamp);
  (synchronizer.*input).add(message);
}

StereoSubscriber::Synchronizer& StereoSubscriber::synchronizerFor(InputIndex index, const ros::Time& stamp) {
  Input& input = inputs_[index];
  if (input.settling) {
    // What is nearer to the time before the jump was still under way when the jump came.
    const bool is_new = (stamp - jump_to_).toSec() < (jump_from_ - stamp).toSec();
    const bool is_caught_up = inputs_[jumped_].last >= jump_from_;
    if (!is_new && !is_caught_up) return *previous_;
    input.settling = false;
  } else if (stamp < input.last) {
    jumped_ = index;
    jump_from_ = input.last;
    jump_to_ = stamp;
    for (Input& other : inputs_) other.settling = &other != &input && other.last > stamp;
    previous_ = std::move(current_);
    current_ = makeSynchronizer();
    monitor_.warning("time jumped back on " + input.topic + ": stereo synchronization starts anew");
  }
  input.last = stamp;
  return *current_;
}

void StereoSubscriber::measureOffset(InputIndex index, const ros::Time& stamp) {
  if (index != LEFT_IMAGE && index != RIGHT_IMAGE) return;
  const ros::Time& other = inputs_[index == LEFT_IMAGE ? RIGHT_IMAGE : LEFT_IMAGE].last;
  if (other.isZero()) return;
  const double offset = std::abs((stamp - other).toSec());
  if (smallest_offset_ < 0.0 || offset < smallest_offset_) smallest_offset_ = offset;
}

void StereoSubscriber::pair(const sensor_msgs::ImageConstPtr& left,
                            const sensor_msgs::CameraInfoConstPtr& left_info,
                            const sensor_msgs::ImageConstPtr& right,
                            const sensor_msgs::CameraInfoConstPtr& right_info) {
  const auto [first, last] = std::minmax(
      {left->header.stamp, left_info->header.stamp, right->header.stamp, right_info->header.stamp});
  last_offset_ = (left->header.stamp - right->header.stamp).toSec();
  if (approximate_ && (last - first).toSec() > max_interval_) {
    ++rejected_;
    monitor_.received();
    monitor_.dropped(DropReason::TOO_FAR_APART);
    return;
  }
  ++pairs_;
  for (Input& input : inputs_) input.received = 0;
  smallest_offset_ = -1.0;
  problem_.clear();
  callback_({left, right, left_info, right_info});
}

void StereoSubscriber::checkForPairs() {
  const bool any =
      std::any_of(inputs_.begin(), inputs_.end(), [](const Input& input) { return input.received > 0; });
  if (pairs_ == pairs_at_last_check_ && any) {
    std::ostringstream text;
    text << "no synchronized stereo pair for " << warning_period_ << " s; messages:";
    bool all = true;
    for (const Input& input : inputs_) {
      text << " " << input.topic << " " << input.received << (&input == &inputs_.back() ? "" : ",");
      all = all && input.received > 0;
    }
    if (!all) {
      text << "; a topic without messages: check the names and remaps";
    } else if (smallest_offset_ >= 0.0) {
      text << "; left and right stamps differ by at least " << smallest_offset_ << " s: ";
      if (approximate_) {
        text << "set ~approximate_sync_max_interval (" << max_interval_ << " s) above it";
      } else {
        text << "set ~approximate_sync to true and ~approximate_sync_max_interval above it";
      }
    }
    problem_ = text.str();
    monitor_.warning(problem_);
    for (Input& input : inputs_) input.received = 0;
    smallest_offset_ = -1.0;
  }
  pairs_at_last_check_ = pairs_;
}

void StereoSubscriber::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  if (!problem_.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, problem_);
  status.add("synchronization", approximate_ ? "approximate" : "exact");
  for (const Input& input : inputs_) status.add("messages on " + input.topic, input.total);
  if (pairs_ + rejected_ > 0) status.add("left minus right stamp of the last pair [ms]", 1e3 * last_offset_);
  if (smallest_offset_ >= 0.0) {
    status.add("smallest distance of left and right stamps since then [ms]", 1e3 * smallest_offset_);
  }
  status.add("pairs", pairs_);
  status.add("pairs rejected, too far apart", rejected_);
}

}  // namespace disparity_refinement
