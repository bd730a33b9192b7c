#include <gtest/gtest.h>

#include <memory>

#include "disparity_refinement/ros/FlowControl.hpp"

namespace disparity_refinement {
namespace {

constexpr int MANY_PROCESSORS = 8;

class Flow : public testing::Test {
 protected:
  void start(std::size_t max_frames, int processors = MANY_PROCESSORS) {
    flow_ = std::make_unique<FlowControl>(max_frames, processors);
  }

  /// A frame that was matched in a tenth of a second; the stamp is arbitrary.
  void match(int frame) { flow_->matched(ros::Time(1000 - frame, 0), 0.1, now_); }
  void refine(int frame) { flow_->refined(ros::Time(1000 - frame, 0), now_); }
  double delay() { return flow_->delay(now_); }
  void pass(double seconds) { now_ += ros::WallDuration(seconds); }
  /// One frame after the other.
  void refineInTurn(int frames, double seconds) {
    for (int i = 0; i < frames; ++i) {
      match(i);
      pass(seconds);
      refine(i);
    }
  }

  std::unique_ptr<FlowControl> flow_;
  ros::SteadyTime now_{1e5};
};

TEST_F(Flow, keepsNothingWhileNobodyRefines) {
  start(1);
  for (int i = 0; i < 10; ++i) {
    match(i);
    EXPECT_EQ(delay(), 0.0);
  }
}

TEST_F(Flow, waitsUntilTheFrameIsRefined) {
  start(1);
  refineInTurn(1, 0.2);
  EXPECT_EQ(delay(), 0.0);
  match(1);
  EXPECT_GT(delay(), 0.2) << "longer than a refinement";
  refine(1);
  EXPECT_EQ(delay(), 0.0);
}

TEST_F(Flow, letsAsManyFramesBeUnfinishedAsItIsTold) {
  start(3);
  refineInTurn(1, 0.2);
  match(1);
  match(2);
  EXPECT_EQ(delay(), 0.0);
  match(3);
  EXPECT_GT(delay(), 0.0);
  refine(1);
  EXPECT_EQ(delay(), 0.0);
}

TEST_F(Flow, takesEarlierFramesForFinished) {
  start(2);
  refineInTurn(1, 0.2);
  match(1);
  match(2);
  refine(2);
  match(3);
  EXPECT_EQ(delay(), 0.0);
}

TEST_F(Flow, doesNotWaitForeverForALostFrame) {
  start(1);
  refineInTurn(1, 0.2);
  match(1);
  const double first = delay();
  EXPECT_LT(first, 1.0);
  pass(0.5 * first);
  EXPECT_NEAR(delay(), 0.5 * first, 1e-6);
  pass(0.6 * first);
  EXPECT_EQ(delay(), 0.0);
  match(2);
  EXPECT_EQ(delay(), 0.0) << "the refinement has not said anything since";
  refine(2);
  match(3);
  EXPECT_GT(delay(), 0.0);
}

TEST_F(Flow, doesNotCareForFramesOfSomebodyElse) {
  start(1);
  refine(7);
  match(1);
  EXPECT_EQ(delay(), 0.0);
  refine(8);
  EXPECT_EQ(delay(), 0.0);
}

TEST_F(Flow, learnsThatTheRefinementIsSlowerNow) {
  start(1);
  refineInTurn(1, 0.021);
  // Nobody would answer as late as this.
  for (int i = 1; i < 6; ++i) {
    match(i);
    pass(0.1);
    EXPECT_EQ(delay(), 0.0) << i;
  }
  pass(0.1);
  refine(1);
  EXPECT_GT(delay(), 0.5) << "the others are under way";
  refine(5);
  EXPECT_EQ(delay(), 0.0);
}

TEST_F(Flow, overlapsTheStagesWhereThereAreProcessorsForBoth) {
  for (const int processors : {1, 2, 3, MANY_PROCESSORS}) {
    start(FlowControl::AUTOMATIC, processors);
    refineInTurn(1, 0.1);
    match(1);
    EXPECT_EQ(delay() == 0.0, processors > 2) << processors;
    match(2);
    EXPECT_GT(delay(), 0.0);
  }
}

TEST_F(Flow, overlapsTheStagesIfTheSecondIsShort) {
  start(FlowControl::AUTOMATIC, 2);
  refineInTurn(1, 0.021);
  match(1);
  EXPECT_EQ(delay(), 0.0);
  match(2);
  EXPECT_GT(delay(), 0.0);
}

TEST_F(Flow, isNotHeldUpByAFrameThatWasHeldUp) {
  start(1);
  refineInTurn(1, 60.0);
  match(1);
  EXPECT_GT(delay(), 0.0);
  EXPECT_LT(delay(), 5.0);
}

TEST_F(Flow, takesAnAnswerForTheNewestFrameOfItsStamp) {
  start(1);
  match(1);
  pass(1.5);
  match(1);
  pass(0.1);
  refine(1);
  EXPECT_EQ(delay(), 0.0) << "nothing is under way";
  match(2);
  EXPECT_LT(delay(), 0.5) << "a refinement takes a tenth of a second";
}

}  // namespace
}  // namespace disparity_refinement
