// What joins the streams of messages in the nodelets: any stamps in any order.

#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <boost/make_shared.hpp>
#include <cstdint>
#include <set>

#include "Input.hpp"
#include "disparity_refinement/ros/FrameGate.hpp"
#include "disparity_refinement/ros/OptionalJoin.hpp"
#include "disparity_refinement/ros/StampJoin.hpp"
#include "disparity_refinement/ros/StereoJoin.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

using sensor_msgs::CameraInfo;
using sensor_msgs::Image;

// Mostly one of a few frames, a little early or late now and then; no other than the bridge lets pass.
ros::Time stampOf(Input& input) {
  if (input.oneIn(16))
    return ros::Time(static_cast<std::uint32_t>(input.number(0, 0x7fffffff)),
                     static_cast<std::uint32_t>(input.number(0, 999999999)));
  const int jitter = input.oneIn(4) ? input.number(-9, 9) * 1000000 : 0;
  return ros::Time().fromNSec(1000000000U + input.number(0, 5) * 100000000U + jitter);
}

// Numbered in the order of arrival.
template <typename Message>
boost::shared_ptr<Message> messageAt(const ros::Time& stamp, std::uint32_t number) {
  const auto message = boost::make_shared<Message>();
  message->header.stamp = stamp;
  message->header.seq = number;
  return message;
}

// The messages of one stream that come out: in the order in which they went in, none twice.
class Order {
 public:
  template <typename MessagePtr>
  void add(const MessagePtr& message) {
    require(message->header.seq > last_, "messages come out once, and in order");
    last_ = message->header.seq;
  }

 private:
  std::uint32_t last_ = 0;
};

void testStereo(Input& input) {
  const int capacity = input.number(1, 6);
  const double interval = input.oneOf({0.0, 0.0, 1e-6, 0.005, 0.02, 3600.0});
  int in = 0, out = 0, dropped = 0;
  Order left, right, left_info, right_info;
  StereoJoin join(
      static_cast<std::size_t>(capacity), interval,
      [&](const StereoFrame& frame) {
        out += 2;
        left.add(frame.left);
        right.add(frame.right);
        left_info.add(frame.left_info);
        right_info.add(frame.right_info);
        const auto [first, last] =
            std::minmax({frame.left->header.stamp, frame.right->header.stamp, frame.left_info->header.stamp,
                         frame.right_info->header.stamp});
        require((last - first).toSec() <= interval, "a pair lies within the interval");
      },
      [&](int images) { dropped += images; });
  std::uint32_t number = 0;
  for (int i = input.number(0, 60); i > 0; --i) {
    const ros::Time stamp = stampOf(input);
    // One stream alone, or a whole frame.
    const int stream = input.number(0, 7);
    ++number;
    if (stream == 0 || stream > 3) join.addLeft(messageAt<Image>(stamp, number));
    if (stream == 1 || stream > 3) join.addRight(messageAt<Image>(stamp, number));
    if (stream == 2 || stream > 3) join.addLeftInfo(messageAt<CameraInfo>(stamp, number));
    if (stream == 3 || stream > 3) join.addRightInfo(messageAt<CameraInfo>(stamp, number));
    in += stream > 3 ? 2 : stream < 2 ? 1 : 0;
    const int waiting = in - out - dropped;
    require(waiting >= 0 && waiting <= 2 * capacity, "every image is paired, dropped, or waits");
  }
}

void testStamps(Input& input) {
  const int capacity = input.number(1, 6);
  std::array<int, 3> waiting{};
  std::array<Order, 3> orders;
  using Join = StampJoin<Image, CameraInfo, Image>;
  Join join(
      static_cast<std::size_t>(capacity),
      [&](const Image::ConstPtr& a, const CameraInfo::ConstPtr& b, const Image::ConstPtr& c) {
        require(a->header.stamp == b->header.stamp && b->header.stamp == c->header.stamp,
                "the stamps are the same");
        orders[0].add(a);
        orders[1].add(b);
        orders[2].add(c);
        for (int& number : waiting) --number;
      },
      [&](const Join::Counts& dropped) {
        for (std::size_t i = 0; i < dropped.size(); ++i) waiting[i] -= dropped[i];
      });
  std::uint32_t number = 0;
  for (int i = input.number(0, 60); i > 0; --i) {
    const ros::Time stamp = stampOf(input);
    const int stream = input.number(0, 2);
    ++waiting[static_cast<std::size_t>(stream)];
    ++number;
    if (stream == 0) join.add<0>(messageAt<Image>(stamp, number));
    if (stream == 1) join.add<1>(messageAt<CameraInfo>(stamp, number));
    if (stream == 2) join.add<2>(messageAt<Image>(stamp, number));
    for (const int messages : waiting) {
      require(messages >= 0 && messages <= capacity, "every message is joined, dropped, or waits");
    }
    if (!input.oneIn(32)) continue;
    join.clear();
    waiting = {};
  }
}

void testGate(Input& input) {
  const int capacity = input.number(1, 6);
  int in = 0, out = 0, dropped = 0;
  // Open at once, or not before the end.
  const ros::WallDuration patience(input.oneIn(4) ? 0.0 : 3600.0);
  // In the order of the announcements, which may be any.
  std::set<std::uint32_t> passed;
  FrameGate<Image> gate(
      static_cast<std::size_t>(capacity), patience,
      [&](const Image::ConstPtr& frame) {
        require(passed.insert(frame->header.seq).second, "frames pass once");
        ++out;
      },
      [&](int frames) { dropped += frames; });
  for (int i = input.number(0, 60); i > 0; --i) {
    const ros::Time stamp = stampOf(input);
    switch (input.number(0, 4)) {
      case 0:
      case 1:
        ++in;
        gate.addFrame(messageAt<Image>(stamp, static_cast<std::uint32_t>(in)));
        break;
      case 2:
        gate.expire();
        break;
      default:
        gate.announce(stamp);
    }
    const int waiting = in - out - dropped;
    require(waiting >= 0 && waiting <= capacity, "every frame passes, is dropped, or waits");
  }
}

void testOptional(Input& input) {
  std::uint32_t in = 0, out = 0, messages = 0;
  std::set<std::uint32_t> joined;
  struct Frame {
    ros::Time stamp;
    std::uint32_t number;
  };
  OptionalJoin<Frame, Image> join(
      static_cast<std::size_t>(input.number(1, 6)), [&](const Frame& frame, const Image::ConstPtr& message) {
        require(frame.number == ++out, "frames come out once, and in order");
        if (!message) return;
        require(joined.insert(message->header.seq).second, "messages come out once");
        require(message->header.stamp == frame.stamp, "the stamps are the same");
      });
  for (int i = input.number(0, 60); i > 0; --i) {
    const ros::Time stamp = stampOf(input);
    switch (input.number(0, 5)) {
      case 0:
        join.expire(ros::WallDuration(input.yes() ? -1.0 : 3600.0));
        break;
      case 1:
        if (input.oneIn(4)) join.flush();
        break;
      case 2:
      case 3:
        ++in;
        join.addFrame(stamp, {stamp, in});
        break;
      default:
        join.addMessage(messageAt<Image>(stamp, ++messages));
    }
    require(in - out <= 1, "one frame waits at most");
  }
  join.flush();
  require(in == out, "no frame is lost");
}

}  // namespace

void test(Input& input) {
  switch (input.number(0, 3)) {
    case 0:
      testStamps(input);
      break;
    case 1:
      testGate(input);
      break;
    case 2:
      testOptional(input);
      break;
    default:
      testStereo(input);
  }
}

}  // namespace fuzz
}  // namespace disparity_refinement
