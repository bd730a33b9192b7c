#pragma once

#include <ros/time.h>

#include <algorithm>
#include <boost/shared_ptr.hpp>
#include <cstddef>
#include <deque>
#include <functional>
#include <iterator>
#include <mutex>
#include <optional>
#include <utility>

namespace disparity_refinement {

/// Lets those frames through that another stage has announced to process, so that under overload no work is
/// done for frames which that stage drops. While it announces nothing, everything passes.
///
/// Up to `capacity` frames wait for their announcement, in order of arrival, which alone decides what is old:
/// see StampJoin. Any number of threads may call.
template <class Message>
class FrameGate {
 public:
  using MessagePtr = boost::shared_ptr<const Message>;
  /// Called while the object is locked.
  using Emit = std::function<void(const MessagePtr&)>;
  /// Called with the number of frames that were not announced.
  using Drop = std::function<void(int)>;

  /// @param patience  How long after the last announcement frames wait for theirs.
  FrameGate(std::size_t capacity, const ros::WallDuration& patience, Emit emit, Drop drop)
      : capacity_(capacity), patience_(patience), emit_(std::move(emit)), drop_(std::move(drop)) {}

  void addFrame(const MessagePtr& frame) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (take(announced_, frame->header.stamp)) {
      passed_.clear();
      emit_(frame);
    } else if (!isClosed()) {
      passUnannounced(frame);
    } else {
      waiting_.push_back(frame);
      if (waiting_.size() > capacity_) {
        waiting_.pop_front();
        drop_(1);
      }
    }
  }

  /// The frame with this stamp passes, now or when it comes. What waits longer than it will not be announced
  /// any more.
  void announce(const ros::Time& stamp) {
    const std::lock_guard<std::mutex> lock(mutex_);
    last_announcement_ = ros::SteadyTime::now();
    const auto found = std::find_if(waiting_.rbegin(), waiting_.rend(), [&stamp](const MessagePtr& frame) {
      return frame->header.stamp == stamp;
    });
    if (found != waiting_.rend()) {
      const MessagePtr frame = *found;
      const auto overtaken = std::distance(waiting_.begin(), found.base()) - 1;
      waiting_.erase(waiting_.begin(), found.base());
      passed_.clear();
      if (overtaken > 0) drop_(static_cast<int>(overtaken));
      emit_(frame);
    } else if (!take(passed_, stamp)) {
      keep(stamp, announced_);
    }
  }

  /// Lets everything through when the other stage has fallen silent. To be called now and then.
  void expire() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (isClosed()) return;
    for (const MessagePtr& frame : waiting_) passUnannounced(frame);
    waiting_.clear();
  }

 private:
  bool isClosed() const {
    return last_announcement_ && ros::SteadyTime::now() - *last_announcement_ < patience_;
  }

  void passUnannounced(const MessagePtr& frame) {
    keep(frame->header.stamp, passed_);
    emit_(frame);
  }

  void keep(const ros::Time& stamp, std::deque<ros::Time>& stamps) const {
    stamps.push_back(stamp);
    if (stamps.size() > capacity_) stamps.pop_front();
  }

  /// Whether it was there.
  static bool take(std::deque<ros::Time>& stamps, const ros::Time& stamp) {
    const auto found = std::find(stamps.begin(), stamps.end(), stamp);
    if (found == stamps.end()) return false;
    stamps.erase(found);
    return true;
  }

  const std::size_t capacity_;
  const ros::WallDuration patience_;
  const Emit emit_;
  const Drop drop_;
  std::mutex mutex_;
  std::optional<ros::SteadyTime> last_announcement_;
  std::deque<MessagePtr> waiting_;
  std::deque<ros::Time> announced_;  ///< Frames that have not come yet.
  /// Frames that did not wait for their announcement, since one last did: announcements are in order, and
  /// in a loop the same stamp will come again.
  std::deque<ros::Time> passed_;
};

}  // namespace disparity_refinement
