#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>
#include <stereo_msgs/DisparityImage.h>

#include <boost/make_shared.hpp>
#include <cstdint>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "disparity_refinement/ros/StampJoin.hpp"

namespace disparity_refinement {
namespace {

using Disparity = stereo_msgs::DisparityImage;
using Labels = sensor_msgs::Image;

class StampJoinTest : public testing::Test {
 protected:
  void addDisparity(std::uint32_t second, const std::string& frame = "") {
    const auto message = boost::make_shared<Disparity>();
    message->header.stamp = ros::Time(second, 0);
    message->header.frame_id = frame;
    join_.addFirst(message);
  }

  void addLabels(std::uint32_t second, const std::string& frame = "") {
    const auto message = boost::make_shared<Labels>();
    message->header.stamp = ros::Time(second, 0);
    message->header.frame_id = frame;
    join_.addSecond(message);
  }

  using Seconds = std::vector<std::uint32_t>;
  using Frames = std::vector<std::pair<std::string, std::string>>;
  Seconds matched_;
  Frames frames_;
  int dropped_ = 0;
  StampJoin<Disparity, Labels> join_{3,
                                     [this](const Disparity::ConstPtr& a, const Labels::ConstPtr& b) {
                                       EXPECT_EQ(a->header.stamp, b->header.stamp);
                                       matched_.push_back(a->header.stamp.sec);
                                       frames_.emplace_back(a->header.frame_id, b->header.frame_id);
                                     },
                                     [this](const auto& messages) {
                                       dropped_ = std::accumulate(messages.begin(), messages.end(), dropped_);
                                     }};
};

TEST_F(StampJoinTest, joinsWhicheverComesFirst) {
  addLabels(1);
  addDisparity(1);
  addDisparity(2);
  addLabels(2);
  EXPECT_EQ(matched_, (Seconds{1, 2}));
  EXPECT_EQ(dropped_, 0);
}

TEST_F(StampJoinTest, joinsAStreamThatRunsAhead) {
  for (const std::uint32_t second : {1, 2, 3}) addLabels(second);
  EXPECT_TRUE(matched_.empty());
  for (const std::uint32_t second : {1, 2, 3}) addDisparity(second);
  EXPECT_EQ(matched_, (Seconds{1, 2, 3}));
  EXPECT_EQ(dropped_, 0);
}

TEST_F(StampJoinTest, doesNotJoinNearStamps) {
  const auto disparity = boost::make_shared<Disparity>();
  disparity->header.stamp = ros::Time(1, 1);
  addLabels(1);
  join_.addFirst(disparity);
  EXPECT_TRUE(matched_.empty());
}

TEST_F(StampJoinTest, countsWhatAMatchOvertakes) {
  for (const std::uint32_t second : {1, 2, 3}) addLabels(second);
  addDisparity(5);
  addDisparity(2);  // overtakes labels 1 and disparity 5
  EXPECT_EQ(matched_, (Seconds{2}));
  EXPECT_EQ(dropped_, 2);
  addDisparity(1);
  EXPECT_EQ(matched_, (Seconds{2})) << "labels 1 are gone";
  addDisparity(3);
  EXPECT_EQ(matched_, (Seconds{2, 3})) << "labels 3 are kept";
}

TEST_F(StampJoinTest, keepsTheNewestUpToTheCapacity) {
  for (const std::uint32_t second : {1, 2, 3}) addLabels(second);
  EXPECT_EQ(dropped_, 0);
  addLabels(4);
  EXPECT_EQ(dropped_, 1);
  addDisparity(1);
  EXPECT_TRUE(matched_.empty());
  addDisparity(2);
  EXPECT_EQ(matched_, (Seconds{2}));
}

TEST_F(StampJoinTest, countsEveryMessageOfAStreamWithoutPartner) {
  for (std::uint32_t second = 0; second < 10; ++second) addDisparity(second);
  EXPECT_EQ(dropped_, 7);
}

TEST_F(StampJoinTest, joinsAcrossAJumpBack) {
  for (int loop = 0; loop < 3; ++loop) {
    for (const std::uint32_t second : {1, 2}) {
      addLabels(second);
      addDisparity(second);
    }
  }
  EXPECT_EQ(matched_, (Seconds{1, 2, 1, 2, 1, 2}));
  EXPECT_EQ(dropped_, 0);
}

TEST_F(StampJoinTest, takesTheNewestOfEqualStamps) {
  addLabels(1, "first loop");
  addLabels(2, "first loop");
  addLabels(1, "second loop");
  addDisparity(1, "second loop");
  EXPECT_EQ(frames_, (Frames{{"second loop", "second loop"}}));
  EXPECT_EQ(dropped_, 2);
}

TEST_F(StampJoinTest, forgetsAllOnClear) {
  addLabels(1);
  addDisparity(2);
  join_.clear();
  addDisparity(1);
  addLabels(2);
  EXPECT_TRUE(matched_.empty());
}

class StampJoinOfThreeTest : public testing::Test {
 protected:
  template <std::size_t I>
  void add(std::uint32_t second, const std::string& frame = "") {
    const auto message = boost::make_shared<Labels>();
    message->header.stamp = ros::Time(second, 0);
    message->header.frame_id = frame;
    join_.add<I>(message);
  }

  std::vector<std::string> matched_;
  int dropped_ = 0;
  StampJoin<Labels, Labels, Labels> join_{
      2,
      [this](const Labels::ConstPtr& a, const Labels::ConstPtr& b, const Labels::ConstPtr& c) {
        EXPECT_EQ(a->header.stamp, b->header.stamp);
        EXPECT_EQ(a->header.stamp, c->header.stamp);
        matched_.push_back(std::to_string(a->header.stamp.sec) + a->header.frame_id + b->header.frame_id +
                           c->header.frame_id);
      },
      [this](const auto& messages) {
        dropped_ = std::accumulate(messages.begin(), messages.end(), dropped_);
      }};
};

TEST_F(StampJoinOfThreeTest, joinsInAnyOrderOfArrival) {
  add<0>(1, "a");
  add<1>(1, "b");
  EXPECT_TRUE(matched_.empty());
  add<2>(1, "c");
  add<2>(2, "c");
  add<0>(2, "a");
  add<1>(2, "b");
  add<1>(3, "b");
  add<2>(3, "c");
  add<0>(3, "a");
  EXPECT_EQ(matched_, (std::vector<std::string>{"1abc", "2abc", "3abc"}));
  EXPECT_EQ(dropped_, 0);
}

TEST_F(StampJoinOfThreeTest, needsAllOfOneStamp) {
  add<0>(1);
  add<1>(1);
  add<2>(2);
  add<0>(2);
  EXPECT_TRUE(matched_.empty());
  EXPECT_EQ(dropped_, 0);
}

TEST_F(StampJoinOfThreeTest, countsWhatAMatchOvertakesInEveryStream) {
  add<0>(1);
  add<1>(1);
  add<0>(2);
  add<2>(2);
  add<1>(2);
  EXPECT_EQ(matched_, (std::vector<std::string>{"2"}));
  EXPECT_EQ(dropped_, 2) << "the first of two streams";
  add<2>(1);
  EXPECT_EQ(matched_.size(), 1U) << "the others of this stamp are gone";
}

TEST_F(StampJoinOfThreeTest, keepsTheNewestUpToTheCapacity) {
  for (const std::uint32_t second : {1, 2, 3}) {
    add<0>(second);
    add<1>(second);
  }
  EXPECT_EQ(dropped_, 2);
  for (const std::uint32_t second : {1, 2, 3}) add<2>(second);
  EXPECT_EQ(matched_, (std::vector<std::string>{"2", "3"}));
  EXPECT_EQ(dropped_, 3) << "the first of the third stream too";
}

TEST_F(StampJoinOfThreeTest, forgetsAllOnClear) {
  add<0>(1);
  add<1>(1);
  join_.clear();
  add<2>(1);
  EXPECT_TRUE(matched_.empty());
}

}  // namespace
}  // namespace disparity_refinement
