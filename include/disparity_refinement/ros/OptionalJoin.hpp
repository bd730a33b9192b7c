#pragma once

#include <ros/time.h>

#include <algorithm>
#include <boost/shared_ptr.hpp>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>

namespace disparity_refinement {

/// Gives every frame the message with its stamp of another stream, which may fail: a frame whose message is
/// not there waits for it until a later message or the next frame comes, or expire() finds it too old, and
/// then goes on without. So no frame is lost, and they keep their order.
///
/// Up to `capacity` messages are kept in order of arrival, which alone decides what is old: see StampJoin.
/// Any number of threads may call.
template <class Frame, class Message>
class OptionalJoin {
 public:
  using MessagePtr = boost::shared_ptr<const Message>;
  /// Called while the object is locked. The message is null if none came.
  using Emit = std::function<void(const Frame&, const MessagePtr&)>;

  OptionalJoin(std::size_t capacity, Emit emit) : capacity_(capacity), emit_(std::move(emit)) {}

  void addFrame(const ros::Time& stamp, const Frame& frame) {
    const std::lock_guard<std::mutex> lock(mutex_);
    release(nullptr);
    waiting_ = Waiting{stamp, ros::SteadyTime::now(), frame};
    const auto found =
        std::find_if(messages_.rbegin(), messages_.rend(),
                     [&stamp](const MessagePtr& message) { return message->header.stamp == stamp; });
    if (found == messages_.rend()) return;
    const MessagePtr message = *found;
    messages_.erase(messages_.begin(), found.base());
    release(message);
  }

  void addMessage(const MessagePtr& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (waiting_ && waiting_->stamp == message->header.stamp) {
      release(message);
      return;
    }
    // Streams are in order, so the one of the waiting frame has been lost.
    if (waiting_ && waiting_->stamp < message->header.stamp) release(nullptr);
    is_missing_ = false;
    messages_.push_back(message);
    if (messages_.size() > capacity_) messages_.pop_front();
  }

  /// Ends a wait that is longer than `patience`, or than a tenth of it if a frame has waited in vain and no
  /// message has come since. To be called now and then.
  void expire(const ros::WallDuration& patience) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!waiting_ || ros::SteadyTime::now() - waiting_->since <= patience * (is_missing_ ? 0.1 : 1.0)) return;
    release(nullptr);
    is_missing_ = true;
  }

  /// Ends the wait and forgets the messages: none will come any more.
  void flush() {
    const std::lock_guard<std::mutex> lock(mutex_);
    release(nullptr);
    messages_.clear();
    is_missing_ = false;
  }

 private:
  struct Waiting {
    ros::Time stamp;
    ros::SteadyTime since;
    Frame frame;
  };

  void release(const MessagePtr& message) {
    if (!waiting_) return;
    emit_(waiting_->frame, message);
    waiting_.reset();
  }

  const std::size_t capacity_;
  const Emit emit_;
  std::mutex mutex_;
  std::optional<Waiting> waiting_;
  bool is_missing_ = false;  ///< A frame has waited in vain, and no message has come since.
  std::deque<MessagePtr> messages_;
};

}  // namespace disparity_refinement
