#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <string>
#include <vector>

#include "disparity_refinement/ros/StereoJoin.hpp"

namespace disparity_refinement {
namespace {

constexpr std::size_t CAPACITY = 3;

/// The frame_id holds the name of the input and the time in milliseconds: a pair becomes "L1 R1 l1 r1".
class StereoJoinTest : public testing::Test {
 protected:
  explicit StereoJoinTest(double interval = 0.0)
      : join_(
            CAPACITY, interval,
            [this](const StereoFrame& frame) {
              pairs_.push_back(frame.left->header.frame_id + " " + frame.right->header.frame_id + " " +
                               frame.left_info->header.frame_id + " " + frame.right_info->header.frame_id);
            },
            [this](int images) { dropped_ += images; }) {}

  /// A time for each of the inputs named: "Llr" are the left image and both CameraInfos.
  void add(const std::string& inputs, int milliseconds) {
    for (const char input : inputs) {
      if (input == 'L') join_.addLeft(make<sensor_msgs::Image>(input, milliseconds));
      if (input == 'R') join_.addRight(make<sensor_msgs::Image>(input, milliseconds));
      if (input == 'l') join_.addLeftInfo(make<sensor_msgs::CameraInfo>(input, milliseconds));
      if (input == 'r') join_.addRightInfo(make<sensor_msgs::CameraInfo>(input, milliseconds));
    }
  }

  template <class Message>
  static boost::shared_ptr<Message> make(char input, int milliseconds) {
    const auto message = boost::make_shared<Message>();
    message->header.stamp.fromNSec(static_cast<std::uint64_t>(milliseconds) * 1000000);
    message->header.frame_id = input + std::to_string(milliseconds);
    return message;
  }

  using Texts = std::vector<std::string>;
  static std::string pairOf(int milliseconds) {
    const std::string time = std::to_string(milliseconds);
    return "L" + time + " R" + time + " l" + time + " r" + time;
  }

  Texts pairs_;
  int dropped_ = 0;
  StereoJoin join_;
};

TEST_F(StereoJoinTest, joinsInAnyOrderOfArrival) {
  int time = 0;
  for (const char* order : {"LRlr", "lrLR", "RrLl", "rLRl"}) {
    add(std::string(order).substr(0, 3), ++time);
    EXPECT_EQ(pairs_.size(), static_cast<std::size_t>(time - 1)) << order;
    add(std::string(order).substr(3), time);
    ASSERT_EQ(pairs_.size(), static_cast<std::size_t>(time)) << order;
    EXPECT_EQ(pairs_.back(), pairOf(time));
  }
  EXPECT_EQ(dropped_, 0);
}

TEST_F(StereoJoinTest, joinsACameraThatRunsAhead) {
  for (const int time : {1, 2, 3}) add("Ll", time);
  for (const int time : {1, 2, 3}) add("Rr", time);
  EXPECT_EQ(pairs_, (Texts{pairOf(1), pairOf(2), pairOf(3)}));
  EXPECT_EQ(dropped_, 0);
}

TEST_F(StereoJoinTest, doesNotJoinNearStamps) {
  add("Llr", 1);
  add("R", 2);
  EXPECT_TRUE(pairs_.empty());
  add("R", 1);
  EXPECT_EQ(pairs_, (Texts{pairOf(1)}));
  EXPECT_EQ(dropped_, 1) << "the right image of 2 came before";
}

TEST_F(StereoJoinTest, countsWhatAPairOvertakes) {
  add("LlRr", 1);
  add("Llr", 2);  // R lost
  add("lRr", 3);  // L lost
  add("LlRr", 4);
  EXPECT_EQ(pairs_, (Texts{pairOf(1), pairOf(4)}));
  EXPECT_EQ(dropped_, 2);
}

TEST_F(StereoJoinTest, keepsTheNewestOfEveryStream) {
  // More than fit, of both cameras one after the other.
  for (int time = 1; time <= 8; ++time) add("Ll", time);
  EXPECT_EQ(dropped_, 5);
  for (int time = 1; time <= 8; ++time) add("Rr", time);
  EXPECT_EQ(pairs_, (Texts{pairOf(6), pairOf(7), pairOf(8)}));
  EXPECT_EQ(dropped_, 10);
}

TEST_F(StereoJoinTest, countsEveryImageOfACameraWithoutPartner) {
  for (int time = 1; time <= 10; ++time) add("LlRl", time);
  EXPECT_TRUE(pairs_.empty());
  EXPECT_EQ(dropped_, 2 * 7);
}

TEST_F(StereoJoinTest, joinsAcrossAJumpBack) {
  for (int loop = 0; loop < 3; ++loop) {
    for (const int time : {100, 200}) add("LlRr", time);
    // Without partner, in a queue that they fill.
    for (const int time : {300, 400, 500, 600}) add("Ll", time);
  }
  EXPECT_EQ(pairs_, (Texts{pairOf(100), pairOf(200), pairOf(100), pairOf(200), pairOf(100), pairOf(200)}));
}

TEST_F(StereoJoinTest, joinsAJumpBackThatReachesTheStreamsOneAfterTheOther) {
  add("LlRr", 900);
  add("Ll", 901);
  add("Ll", 1);
  add("Rr", 901);
  add("Ll", 2);
  add("Rr", 1);
  add("Rr", 2);
  EXPECT_EQ(pairs_, (Texts{pairOf(900), pairOf(901), pairOf(1), pairOf(2)}));
  EXPECT_EQ(dropped_, 0);
}

TEST_F(StereoJoinTest, losesOneFrameToAStampThatJumps) {
  add("LlRr", 100);
  add("lRr", 200);
  add("L", 999999);
  add("lRr", 300);
  add("lRr", 400);
  add("L", 300);
  add("L", 400);
  EXPECT_EQ(pairs_, (Texts{pairOf(100), pairOf(300), pairOf(400)}));
}

TEST_F(StereoJoinTest, takesTheNewestOfEqualStamps) {
  add("L", 1);
  const auto again = make<sensor_msgs::Image>('L', 1);
  again->header.frame_id = "again";
  join_.addLeft(again);
  add("lRr", 1);
  EXPECT_EQ(pairs_, (Texts{"again R1 l1 r1"}));
}

TEST_F(StereoJoinTest, joinsStampsAtBothEndsOfTime) {
  const auto late = make<sensor_msgs::Image>('L', 1);
  late->header.stamp = ros::Time(4294967295U, 999999999U);
  join_.addLeft(late);
  add("Rlr", 1);
  EXPECT_TRUE(pairs_.empty());
  add("L", 1);
  EXPECT_EQ(pairs_, (Texts{pairOf(1)}));
}

TEST_F(StereoJoinTest, forgetsAllOnClear) {
  add("Llr", 1);
  join_.clear();
  add("R", 1);
  EXPECT_TRUE(pairs_.empty());
}

class ApproximateStereoJoinTest : public StereoJoinTest {
 protected:
  ApproximateStereoJoinTest() : StereoJoinTest(0.010) {}
};

TEST_F(ApproximateStereoJoinTest, joinsWithinTheInterval) {
  add("Ll", 100);
  add("Rr", 110);
  add("Rr", 190);
  add("Ll", 200);
  EXPECT_EQ(pairs_, (Texts{"L100 R110 l100 r110", "L200 R190 l200 r190"}));
  add("Ll", 300);
  add("Rr", 311);
  EXPECT_EQ(pairs_.size(), 2U);
}

TEST_F(ApproximateStereoJoinTest, keepsAllFourWithinTheInterval) {
  add("L", 100);
  add("l", 94);
  add("R", 106);
  add("r", 106);
  EXPECT_TRUE(pairs_.empty());
}

TEST_F(ApproximateStereoJoinTest, takesTheNearest) {
  add("L", 100);
  add("L", 108);
  add("lr", 104);
  add("R", 107);
  EXPECT_EQ(pairs_, (Texts{"L108 R107 l104 r104"}));
  EXPECT_EQ(dropped_, 1);
}

TEST_F(ApproximateStereoJoinTest, isNotShiftedByALostImage) {
  add("LlRr", 0);
  add("lRr", 101);  // L lost
  add("Llr", 200);  // R lost
  add("Ll", 300);
  add("Rr", 301);
  add("Rr", 401);
  add("Ll", 400);
  EXPECT_EQ(pairs_, (Texts{pairOf(0), "L300 R301 l300 r301", "L400 R401 l400 r401"}));
}

}  // namespace
}  // namespace disparity_refinement
