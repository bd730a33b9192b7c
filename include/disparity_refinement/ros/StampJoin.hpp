#pragma once

#include <algorithm>
#include <boost/shared_ptr.hpp>
#include <cstddef>
#include <deque>
#include <functional>
#include <iterator>
#include <utility>

namespace disparity_refinement {

/// Joins two streams of messages with equal stamps, however far one runs ahead of the other.
///
/// Each stream keeps up to `capacity` messages in order of arrival, and arrival alone decides what is old: a
/// jump back in time (rosbag play --loop) needs no special care. Messages that a later match has overtaken
/// are dropped.
template <class A, class B>
class StampJoin {
 public:
  using APtr = boost::shared_ptr<const A>;
  using BPtr = boost::shared_ptr<const B>;
  using Match = std::function<void(const APtr&, const BPtr&)>;
  /// Called with the number of messages of each stream that were dropped without a partner.
  using Drop = std::function<void(int, int)>;

  StampJoin(std::size_t capacity, Match match, Drop drop)
      : capacity_(capacity), match_(std::move(match)), drop_(std::move(drop)) {}

  void addFirst(const APtr& message) {
    add(
        message, first_, second_, [this](const APtr& a, const BPtr& b) { match_(a, b); },
        [this](int own, int other) { drop_(own, other); });
  }

  void addSecond(const BPtr& message) {
    add(
        message, second_, first_, [this](const BPtr& b, const APtr& a) { match_(a, b); },
        [this](int own, int other) { drop_(other, own); });
  }

  void clear() {
    first_.clear();
    second_.clear();
  }

 private:
  template <class Own, class Other, class Emit, class DropBoth>
  void add(const Own& message, std::deque<Own>& own, std::deque<Other>& other, const Emit& emit,
           const DropBoth& drop) {
    // The newest of equal stamps: what is left of an earlier loop is older.
    const auto partner = std::find_if(other.rbegin(), other.rend(), [&message](const Other& candidate) {
      return candidate->header.stamp == message->header.stamp;
    });
    if (partner == other.rend()) {
      own.push_back(message);
      if (own.size() > capacity_) {
        own.pop_front();
        drop(1, 0);
      }
      return;
    }
    const Other found = *partner;
    const auto overtaken = static_cast<int>(std::distance(other.begin(), partner.base()) - 1);
    const auto overtaken_own = static_cast<int>(own.size());
    other.erase(other.begin(), partner.base());
    own.clear();
    if (overtaken_own + overtaken > 0) drop(overtaken_own, overtaken);
    emit(message, found);
  }

  const std::size_t capacity_;
  const Match match_;
  const Drop drop_;
  std::deque<APtr> first_;
  std::deque<BPtr> second_;
};

}  // namespace disparity_refinement
