#pragma once

#include <ros/time.h>

#include <algorithm>
#include <boost/shared_ptr.hpp>
#include <cstddef>
#include <deque>
#include <mutex>

namespace disparity_refinement {

/// The last `capacity` messages of a stream, to be looked up by stamp. Any number of threads may call.
template <class Message>
class StampCache {
 public:
  using MessagePtr = boost::shared_ptr<const Message>;

  explicit StampCache(std::size_t capacity) : capacity_(capacity) {}

  void add(const MessagePtr& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages_.push_back(message);
    if (messages_.size() > capacity_) messages_.pop_front();
  }

  /// The newest with this stamp, or null.
  MessagePtr find(const ros::Time& stamp) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found =
        std::find_if(messages_.rbegin(), messages_.rend(),
                     [&stamp](const MessagePtr& message) { return message->header.stamp == stamp; });
    return found == messages_.rend() ? nullptr : *found;
  }

 private:
  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::deque<MessagePtr> messages_;
};

}  // namespace disparity_refinement
