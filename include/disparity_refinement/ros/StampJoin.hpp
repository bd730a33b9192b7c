#pragma once

#include <ros/time.h>

#include <algorithm>
#include <array>
#include <boost/shared_ptr.hpp>
#include <cstddef>
#include <deque>
#include <functional>
#include <iterator>
#include <tuple>
#include <utility>

namespace disparity_refinement {

/// Joins two or more streams of messages with equal stamps, however far one runs ahead of the others.
///
/// Each stream keeps up to `capacity` messages in order of arrival, and arrival alone decides what is old: a
/// jump back in time (rosbag play --loop) needs no special care. Messages that a later match has overtaken
/// are dropped.
template <class... Messages>
class StampJoin {
 public:
  template <std::size_t I>
  using Ptr = boost::shared_ptr<const std::tuple_element_t<I, std::tuple<Messages...>>>;
  using Match = std::function<void(const boost::shared_ptr<const Messages>&...)>;
  /// Number of messages of each stream.
  using Counts = std::array<int, sizeof...(Messages)>;
  /// Called when messages were dropped without a partner.
  using Drop = std::function<void(const Counts&)>;

  StampJoin(std::size_t capacity, Match match, Drop drop)
      : capacity_(capacity), match_(std::move(match)), drop_(std::move(drop)) {}

  /// Adds a message to the stream of index I.
  template <std::size_t I>
  void add(const Ptr<I>& message) {
    const ros::Time stamp = message->header.stamp;
    auto& own = std::get<I>(streams_);
    own.push_back(message);
    const bool is_complete = std::apply(
        [&stamp](auto&... stream) { return ((find(stream, stamp) != stream.rend()) && ...); }, streams_);
    if (is_complete) {
      emit(stamp);
    } else if (own.size() > capacity_) {
      own.pop_front();
      Counts dropped{};
      dropped[I] = 1;
      drop_(dropped);
    }
  }

  void addFirst(const Ptr<0>& message) { add<0>(message); }
  void addSecond(const Ptr<1>& message) { add<1>(message); }

  void clear() {
    std::apply([](auto&... stream) { (stream.clear(), ...); }, streams_);
  }

 private:
  template <class Stream>
  static auto find(Stream& stream, const ros::Time& stamp) {
    // The newest of equal stamps: what is left of an earlier loop is older.
    return std::find_if(stream.rbegin(), stream.rend(),
                        [&stamp](const auto& message) { return message->header.stamp == stamp; });
  }

  void emit(const ros::Time& stamp) {
    Counts overtaken{};
    auto take = [&stamp, counter = overtaken.begin()](auto& stream) mutable {
      const auto found = find(stream, stamp);
      const auto message = *found;
      *counter++ = static_cast<int>(std::distance(stream.begin(), found.base()) - 1);
      stream.erase(stream.begin(), found.base());
      return message;
    };
    const std::tuple<boost::shared_ptr<const Messages>...> match = std::apply(
        [&take](auto&... stream) {
          // In the order of the streams, since these are braces.
          return std::tuple<boost::shared_ptr<const Messages>...>{take(stream)...};
        },
        streams_);
    if (overtaken != Counts{}) drop_(overtaken);
    std::apply(match_, match);
  }

  const std::size_t capacity_;
  const Match match_;
  const Drop drop_;
  std::tuple<std::deque<boost::shared_ptr<const Messages>>...> streams_;
};

}  // namespace disparity_refinement
