#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>
#include <stereo_msgs/DisparityImage.h>

#include <boost/make_shared.hpp>
#include <cstdint>
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
                                     [this](int first, int second) { dropped_ += first + second; }};
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

}  // namespace
}  // namespace disparity_refinement
