#pragma once

#include <ros/time.h>

#include <algorithm>
#include <cstddef>
#include <deque>
#include <mutex>
#include <utility>

namespace disparity_refinement {

/// Keeps the matching from running ahead of the refinement: under overload its frames would wait there and
/// grow old, or be dropped with the work that they have cost.
///
/// The refinement says which frames it is done with. While it says nothing, nothing is kept. Any number of
/// threads may call.
class FlowControl {
 public:
  static constexpr std::size_t AUTOMATIC = 0;

  /// @param max_frames  Matched frames that may be unfinished when the next one is begun. AUTOMATIC: 1 where
  ///                    the two stages would only share the same processors, otherwise 2.
  FlowControl(std::size_t max_frames, int processors) : max_frames_(max_frames), processors_(processors) {}

  /// A frame has been matched, which took some time [s].
  void matched(const ros::Time& stamp, double seconds, const ros::SteadyTime& now) {
    const std::lock_guard<std::mutex> lock(mutex_);
    matching_time_ = seconds;
    under_way_.emplace_back(stamp, now);
    if (under_way_.size() > std::max(REMEMBERED, max_frames_)) under_way_.pop_front();
  }

  /// This frame, and what was matched before it, has been refined or refused. Frames of somebody else are
  /// ignored.
  void refined(const ros::Time& stamp, const ros::SteadyTime& now) {
    const std::lock_guard<std::mutex> lock(mutex_);
    // The newest: in a loop, an older one of the same stamp may never have been refined.
    const auto found = std::find_if(under_way_.rbegin(), under_way_.rend(),
                                    [&stamp](const auto& frame) { return frame.first == stamp; });
    if (found == under_way_.rend()) return;
    is_answered_ = true;
    refinement_time_ = (now - found->second).toSec();
    under_way_.erase(under_way_.begin(), found.base());
  }

  /// How long to wait before the next frame is begun [s], unless one is refined first; 0: no longer.
  double delay(const ros::SteadyTime& now) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!is_answered_ || under_way_.size() < maxFrames()) return 0.0;
    const double rest = PATIENCE * std::clamp(refinement_time_, MIN_TIME, MAX_TIME) -
                        (now - under_way_.back().second).toSec();
    // The frame was lost on its way, or nobody refines any more.
    if (rest <= 0.0) is_answered_ = false;
    return std::max(0.0, rest);
  }

 private:
  static constexpr std::size_t REMEMBERED = 100;  // Frames.
  static constexpr double PATIENCE = 2.0;         // Refinements like the one before.
  static constexpr double MIN_TIME = 0.02;        // [s]
  static constexpr double MAX_TIME = 2.0;         // Longer, the frame has waited for something else [s].
  static constexpr double SHORT = 0.25;  // Share of the matching's time that a refinement may share with it.

  std::size_t maxFrames() const {
    if (max_frames_ != AUTOMATIC) return max_frames_;
    return processors_ > 2 || refinement_time_ < SHORT * matching_time_ ? 2 : 1;
  }

  const std::size_t max_frames_;
  const int processors_;
  std::mutex mutex_;
  bool is_answered_ = false;
  double matching_time_ = 0.0;
  double refinement_time_ = 0.5;  // From matched() to refined(), with what waits between [s].
  std::deque<std::pair<ros::Time, ros::SteadyTime>> under_way_;
};

}  // namespace disparity_refinement
