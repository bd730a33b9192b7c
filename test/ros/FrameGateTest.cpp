#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>

#include <boost/make_shared.hpp>
#include <chrono>
#include <thread>
#include <vector>

#include "disparity_refinement/ros/FrameGate.hpp"

namespace disparity_refinement {
namespace {

using sensor_msgs::Image;

class Gate : public testing::Test {
 protected:
  static constexpr double LONG = 100.0, SHORT = 0.05;  // [s]

  explicit Gate(double patience = LONG)
      : gate_(
            3, ros::WallDuration(patience),
            [this](const Image::ConstPtr& image) {
              emitted_.push_back(static_cast<int>(image->header.stamp.sec));
            },
            [this](int frames) { dropped_ += frames; }) {}

  void add(int stamp) {
    const auto image = boost::make_shared<Image>();
    image->header.stamp = ros::Time(stamp, 0);
    gate_.addFrame(image);
  }

  static void pause(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

  void announce(int stamp) { gate_.announce(ros::Time(stamp, 0)); }

  using Stamps = std::vector<int>;
  Stamps emitted_;
  int dropped_ = 0;
  FrameGate<Image> gate_;
};

class ImpatientGate : public Gate {
 protected:
  ImpatientGate() : Gate(SHORT) {}
};

TEST_F(Gate, isOpenBeforeTheFirstAnnouncement) {
  add(1);
  add(2);
  EXPECT_EQ(emitted_, (Stamps{1, 2}));
}

TEST_F(Gate, letsAnnouncedFramesThroughInWhateverOrderTheTwoCome) {
  announce(1);
  add(1);
  EXPECT_EQ(emitted_, (Stamps{1}));
  add(2);
  EXPECT_EQ(emitted_, (Stamps{1})) << "not announced";
  announce(2);
  EXPECT_EQ(emitted_, (Stamps{1, 2}));
  EXPECT_EQ(dropped_, 0);
}

TEST_F(Gate, dropsWhatTheAnnouncementHasOvertaken) {
  announce(0);
  add(0);
  for (int stamp : {1, 2, 3}) add(stamp);
  announce(2);
  EXPECT_EQ(emitted_, (Stamps{0, 2}));
  EXPECT_EQ(dropped_, 1);
  announce(3);
  EXPECT_EQ(emitted_, (Stamps{0, 2, 3}));
  EXPECT_EQ(dropped_, 1);
}

TEST_F(Gate, keepsTheNewestFramesOnly) {
  announce(0);
  for (int stamp : {1, 2, 3, 4, 5}) add(stamp);
  EXPECT_EQ(dropped_, 2);
  announce(2);
  EXPECT_EQ(emitted_, Stamps());
  announce(3);
  EXPECT_EQ(emitted_, (Stamps{3}));
}

TEST_F(Gate, followsTimeThatJumpsBack) {
  announce(0);
  for (int loop = 0; loop < 2; ++loop) {
    emitted_.clear();
    for (int stamp : {1, 2}) {
      add(stamp);
      announce(stamp);
    }
    EXPECT_EQ(emitted_, (Stamps{1, 2}));
  }
  EXPECT_EQ(dropped_, 0);
}

TEST_F(Gate, forgetsTheAnnouncementOfAFrameThatHasPassed) {
  add(1);
  add(2);
  announce(1);
  announce(2);
  add(3);
  // Played again: in the order of the announcements, not 2 before 1 or 3.
  add(2);
  add(1);
  EXPECT_EQ(emitted_, (Stamps{1, 2}));
  announce(3);
  announce(1);
  EXPECT_EQ(emitted_, (Stamps{1, 2, 3, 1}));
}

TEST_F(Gate, doesNotTakeAStampThatComesAgainForAFrameThatHasPassed) {
  // Nobody announced those.
  add(1);
  add(2);
  announce(5);
  add(5);
  add(6);
  announce(6);
  announce(1);
  add(1);
  announce(2);
  add(2);
  EXPECT_EQ(emitted_, (Stamps{1, 2, 5, 6, 1, 2}));
  EXPECT_EQ(dropped_, 0);
}

TEST_F(ImpatientGate, opensWhenTheAnnouncementsEnd) {
  announce(0);
  add(1);
  pause(2.0 * SHORT);
  gate_.expire();
  EXPECT_EQ(emitted_, (Stamps{1}));
  add(2);
  EXPECT_EQ(emitted_, (Stamps{1, 2}));
  EXPECT_EQ(dropped_, 0);
}

}  // namespace
}  // namespace disparity_refinement
