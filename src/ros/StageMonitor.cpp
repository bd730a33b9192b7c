#include "disparity_refinement/ros/StageMonitor.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

#include "disparity_refinement/ros/StartParameters.hpp"

namespace disparity_refinement {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using diagnostic_updater::DiagnosticStatusWrapper;

const ros::WallDuration REPEAT_PERIOD(5.0);
/// Texts remembered for throttling; one that holds a changing number must not fill the memory.
constexpr std::size_t REMEMBERED_TEXTS = 32;
/// Of a bag that is played without its clock, say [s].
constexpr double AGE_OF_ANOTHER_CLOCK = 3600.0;
/// In the order of DropReason.
constexpr const char* REASON_NAMES[] = {"queue full", "no partner", "bad"};

template <class... Parts>
std::string join(const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  return text.str();
}

}  // namespace

StageMonitor::StageMonitor(const std::string& name, const ros::NodeHandle& nh,
                           const ros::NodeHandle& private_nh)
    : name_(name),
      min_rate_(startParameter(private_nh, "diagnostics_min_rate", 0.0, 0.0, 1e6)),
      max_dropped_(startParameter(private_nh, "diagnostics_max_dropped", 0.0, 0.0, 1.0)),
      max_age_(startParameter(private_nh, "diagnostics_max_age", 0.0, 0.0, 1e6)),
      updater_(nh, private_nh, name) {
  updater_.setHardwareID("none");
  updater_.add("frames", [this](DiagnosticStatusWrapper& status) { report(status); });
  // Steady time: the updater's own period stands still when the simulated time jumps back.
  timer_ = private_nh.createSteadyTimer(
      ros::WallDuration(1.0), [this](const ros::SteadyTimerEvent&) { updater_.force_update(); }, false,
      false);
}

void StageMonitor::start() { timer_.start(); }

void StageMonitor::stop() { timer_.stop(); }

void StageMonitor::addDiagnostics(const Task& task) { tasks_.push_back(task); }

void StageMonitor::setActive(bool is_active) {
  const std::lock_guard<std::mutex> lock(mutex_);
  is_active_ = is_active;
}

void StageMonitor::received(int frames) {
  const std::lock_guard<std::mutex> lock(mutex_);
  total_.received += frames;
}

void StageMonitor::dropped(DropReason reason, int frames) {
  const std::lock_guard<std::mutex> lock(mutex_);
  total_.dropped[static_cast<std::size_t>(reason)] += frames;
}

void StageMonitor::published(const ros::Time& stamp, double milliseconds) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++total_.published;
  milliseconds_.add(milliseconds);
  age_.add((ros::Time::now() - stamp).toSec());
}

long StageMonitor::Counts::allDropped() const { return std::accumulate(dropped.begin(), dropped.end(), 0L); }

void StageMonitor::Figure::add(double value) {
  sum += value;
  max = std::max(max, value);
}

bool StageMonitor::isDue(const std::string& text) {
  const ros::SteadyTime now = ros::SteadyTime::now();
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

void StageMonitor::summarize(double seconds, DiagnosticStatusWrapper& status) const {
  const long frames = total_.published - reported_.published;
  const long received = total_.received - reported_.received;
  const long lost = total_.lost() - reported_.lost();
  const double rate = static_cast<double>(frames) / seconds;

  const char* activity = !is_active_ ? "nobody listens" : received > 0 || frames > 0 ? "running" : "no input";
  status.summary(DiagnosticStatus::OK, activity);
  if (is_active_ && rate < min_rate_) {
    status.mergeSummary(DiagnosticStatus::WARN, join(rate, " Hz, expected at least ", min_rate_, " Hz"));
  }
  if (static_cast<double>(lost) > max_dropped_ * static_cast<double>(received)) {
    status.mergeSummary(DiagnosticStatus::WARN, join(lost, " of ", received, " frames are dropped"));
  }
  if (max_age_ > 0.0 && age_.max > max_age_) {
    status.mergeSummary(DiagnosticStatus::WARN,
                        join("a frame was ", age_.max, " s old, expected at most ", max_age_, " s"));
  }
  if (total_.errors > reported_.errors) status.summary(DiagnosticStatus::ERROR, last_error_);
}

void StageMonitor::report(DiagnosticStatusWrapper& status) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const ros::SteadyTime now = ros::SteadyTime::now();
    const double seconds = std::max(1e-3, (now - last_report_).toSec());
    const auto frames = static_cast<double>(total_.published - reported_.published);
    summarize(seconds, status);

    status.add("input rate [Hz]", static_cast<double>(total_.received - reported_.received) / seconds);
    status.add("output rate [Hz]", frames / seconds);
    if (frames > 0.0) {
      status.add("processing time, mean [ms]", milliseconds_.sum / frames);
      status.add("processing time, max [ms]", milliseconds_.max);
      if (std::abs(age_.sum / frames) < AGE_OF_ANOTHER_CLOCK) {
        status.add("age at publication, mean [ms]", 1e3 * age_.sum / frames);
        status.add("age at publication, max [ms]", 1e3 * age_.max);
      } else {
        status.add("age at publication, mean [ms]", "unknown: the stamps are not of this clock");
      }
    }
    status.add("frames received", total_.received);
    status.add("frames published", total_.published);
    status.add("frames dropped", total_.allDropped());
    for (std::size_t reason = 0; reason < REASONS; ++reason) {
      status.add(join("frames dropped, ", REASON_NAMES[reason]), total_.dropped[reason]);
    }
    status.add("errors", total_.errors);
    if (!last_error_.empty()) status.add("last error", last_error_);

    reported_ = total_;
    milliseconds_ = age_ = {};
    last_report_ = now;
  }
  for (const Task& task : tasks_) task(status);
}

}  // namespace disparity_refinement
