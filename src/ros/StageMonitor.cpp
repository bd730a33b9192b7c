#include "disparity_refinement/ros/StageMonitor.hpp"

#include <algorithm>

namespace disparity_refinement {
namespace {

const ros::WallDuration REPEAT_PERIOD(5.0);
/// Texts remembered for throttling; one that holds a changing number must not fill the memory.
constexpr std::size_t REMEMBERED_TEXTS = 32;

}  // namespace

StageMonitor::StageMonitor(const std::string& name, const ros::NodeHandle& nh,
                           const ros::NodeHandle& private_nh)
    : name_(name), updater_(nh, private_nh, name) {
  updater_.setHardwareID("none");
  updater_.add("frames", [this](diagnostic_updater::DiagnosticStatusWrapper& status) { report(status); });
  // Wall time: the updater's own period stands still when the simulated time jumps back.
  timer_ = private_nh.createWallTimer(
      ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) { updater_.force_update(); }, false, false);
}

void StageMonitor::start() { timer_.start(); }

void StageMonitor::addDiagnostics(
    const std::function<void(diagnostic_updater::DiagnosticStatusWrapper&)>& task) {
  tasks_.push_back(task);
}

void StageMonitor::received() {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++total_.received;
}

void StageMonitor::dropped(int frames) {
  const std::lock_guard<std::mutex> lock(mutex_);
  total_.dropped += frames;
}

void StageMonitor::published(const ros::Time& stamp, double milliseconds) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++total_.published;
  milliseconds_sum_ += milliseconds;
  milliseconds_max_ = std::max(milliseconds_max_, milliseconds);
  age_sum_ += (ros::Time::now() - stamp).toSec();
}

bool StageMonitor::isDue(const std::string& text) {
  const ros::WallTime now = ros::WallTime::now();
  const auto found = last_logged_.find(text);
  if (found != last_logged_.end() && now - found->second < REPEAT_PERIOD) return false;
  if (last_logged_.size() >= REMEMBERED_TEXTS) last_logged_.clear();
  last_logged_[text] = now;
  return true;
}

void StageMonitor::error(const std::string& text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++total_.errors;
  last_error_ = text;
  if (isDue(text)) ROS_ERROR_STREAM("[" << name_ << "] " << text);
}

void StageMonitor::warning(const std::string& text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (isDue(text)) ROS_WARN_STREAM("[" << name_ << "] " << text);
}

void StageMonitor::traceReceived(const std::string& topic, const ros::Time& stamp, const void* data) const {
  ROS_DEBUG_STREAM("[" << name_ << "] received " << topic << " " << stamp << " at " << data);
}

void StageMonitor::tracePublished(const std::string& topic, const ros::Time& stamp, const void* data) const {
  ROS_DEBUG_STREAM("[" << name_ << "] published " << topic << " " << stamp << " at " << data);
}

void StageMonitor::report(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using diagnostic_msgs::DiagnosticStatus;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const ros::WallTime now = ros::WallTime::now();
    const double seconds = std::max(1e-3, (now - last_report_).toSec());
    const long frames = total_.published - reported_.published;

    status.summary(DiagnosticStatus::OK, frames > 0 ? "running" : "idle");
    if (total_.dropped > reported_.dropped)
      status.summary(DiagnosticStatus::WARN, "too slow: frames are dropped");
    if (total_.errors > reported_.errors) status.summary(DiagnosticStatus::ERROR, last_error_);

    status.add("rate [Hz]", frames / seconds);
    if (frames > 0) {
      status.add("processing time, mean [ms]", milliseconds_sum_ / frames);
      status.add("processing time, max [ms]", milliseconds_max_);
      status.add("latency since the image's stamp, mean [ms]", 1e3 * age_sum_ / frames);
    }
    status.add("frames received", total_.received);
    status.add("frames published", total_.published);
    status.add("frames dropped", total_.dropped);
    status.add("errors", total_.errors);
    if (!last_error_.empty()) status.add("last error", last_error_);

    reported_ = total_;
    milliseconds_sum_ = milliseconds_max_ = age_sum_ = 0.0;
    last_report_ = now;
  }
  for (const auto& task : tasks_) task(status);
}

}  // namespace disparity_refinement
