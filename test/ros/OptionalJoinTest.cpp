#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>

#include <boost/make_shared.hpp>
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "disparity_refinement/ros/OptionalJoin.hpp"

namespace disparity_refinement {
namespace {

class OptionalJoinTest : public testing::Test {
 protected:
  void addFrame(std::uint32_t second, const std::string& name) { join_.addFrame(ros::Time(second, 0), name); }

  void addMessage(std::uint32_t second, const std::string& name) {
    const auto message = boost::make_shared<sensor_msgs::Image>();
    message->header.stamp = ros::Time(second, 0);
    message->header.frame_id = name;
    join_.addMessage(message);
  }

  using Texts = std::vector<std::string>;
  Texts emitted_;
  OptionalJoin<std::string, sensor_msgs::Image> join_{
      3, [this](const std::string& frame, const sensor_msgs::ImageConstPtr& message) {
        emitted_.push_back(frame + (message ? " " + message->header.frame_id : ""));
      }};
};

TEST_F(OptionalJoinTest, joinsWhicheverComesFirst) {
  addMessage(1, "a");
  addFrame(1, "1");
  addFrame(2, "2");
  EXPECT_EQ(emitted_, (Texts{"1 a"}));
  addMessage(2, "b");
  EXPECT_EQ(emitted_, (Texts{"1 a", "2 b"}));
}

TEST_F(OptionalJoinTest, letsNoFrameWaitForMoreThanTheNext) {
  addFrame(1, "1");
  EXPECT_TRUE(emitted_.empty());
  addMessage(2, "b");
  addFrame(2, "2");
  EXPECT_EQ(emitted_, (Texts{"1", "2 b"}));
  // Too late.
  addMessage(1, "a");
  addFrame(3, "3");
  addFrame(4, "4");
  EXPECT_EQ(emitted_, (Texts{"1", "2 b", "3"}));
}

TEST_F(OptionalJoinTest, keepsTheNewestUpToTheCapacity) {
  for (const std::uint32_t second : {1, 2, 3, 4}) addMessage(second, std::to_string(second));
  addFrame(1, "first");
  addFrame(2, "second");
  EXPECT_EQ(emitted_, (Texts{"first", "second 2"}));
}

TEST_F(OptionalJoinTest, takesTheNewestOfEqualStamps) {
  addMessage(1, "old");
  addMessage(1, "new");
  addFrame(1, "1");
  // What was before is forgotten.
  addFrame(1, "again");
  join_.flush();
  EXPECT_EQ(emitted_, (Texts{"1 new", "again"}));
}

TEST_F(OptionalJoinTest, joinsAcrossAJumpBack) {
  addMessage(5, "late");
  addFrame(5, "5");
  addMessage(1, "early");
  addFrame(1, "1");
  EXPECT_EQ(emitted_, (Texts{"5 late", "1 early"}));
}

TEST_F(OptionalJoinTest, letsNoFrameWaitForLongerThanThePatience) {
  addFrame(1, "1");
  join_.expire(ros::WallDuration(3600.0));
  EXPECT_TRUE(emitted_.empty());
  join_.expire(ros::WallDuration(-1.0));
  EXPECT_EQ(emitted_, (Texts{"1"}));
  join_.expire(ros::WallDuration(-1.0));
  EXPECT_EQ(emitted_, (Texts{"1"}));
}

TEST_F(OptionalJoinTest, doesNotWaitForAMessageThatALaterOneHasOvertaken) {
  addFrame(1, "1");
  addMessage(2, "b");
  EXPECT_EQ(emitted_, (Texts{"1"}));
}

TEST_F(OptionalJoinTest, hasLessPatienceWhileTheStreamHasFailed) {
  const ros::WallDuration PATIENCE(0.1);
  addFrame(1, "1");
  join_.expire(ros::WallDuration(-1.0));
  addFrame(2, "2");
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  join_.expire(PATIENCE);
  EXPECT_EQ(emitted_, (Texts{"1", "2"}));
  addMessage(3, "c");
  addFrame(4, "4");
  join_.expire(ros::WallDuration(3600.0));
  addMessage(4, "d");
  EXPECT_EQ(emitted_, (Texts{"1", "2", "4 d"}));
}

TEST_F(OptionalJoinTest, losesNoFrameWhenItIsFlushed) {
  addMessage(2, "b");
  addFrame(1, "1");
  join_.flush();
  EXPECT_EQ(emitted_, (Texts{"1"}));
  addFrame(2, "2");
  EXPECT_EQ(emitted_, (Texts{"1"}));
  join_.flush();
  join_.flush();
  EXPECT_EQ(emitted_, (Texts{"1", "2"}));
}

}  // namespace
}  // namespace disparity_refinement
