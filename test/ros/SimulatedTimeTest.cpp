// The chain with /use_sim_time: a clock that has not started, stands still and jumps, and `rosbag play
// --loop`.

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosgraph_msgs/Clock.h>

#include <vector>

#include "../core/KittiFixture.hpp"
#include "ChainClient.hpp"
#include "ChildProcess.hpp"
#include "CoreChain.hpp"

namespace disparity_refinement {
namespace {

CoreParameters testParameters() {
  CoreParameters parameters;
  parameters.matching.disparity_range = 64;
  parameters.matching.full_width = true;
  parameters.refinement.mode = RefinementMode::QUALITY;
  return parameters;
}

class SimulatedTime : public testing::Test {
 protected:
  /// Two frames, of which the second has to come out.
  void expectFrames(int first) {
    for (const int index : {first, first + 1}) camera.publish(index);
    EXPECT_TRUE(refined.wait(StereoCamera::stamp(first + 1))) << first;
    EXPECT_EQ(camera.countWrongPairs(refined), 0);
  }

  void expectDiagnostics() {
    diagnostics.clear();
    EXPECT_TRUE(diagnostics.wait([](const diagnostic_msgs::DiagnosticArray& array) {
      return array.status.at(0).name.find("stereo/") != std::string::npos;
    })) << "nothing on /diagnostics";
  }

  ros::NodeHandle nh{"/stereo"};
  KnownCamera camera{nh, testParameters()};
  Listener<stereo_msgs::DisparityImage> refined{nh, "disparity_refined"};
  Listener<diagnostic_msgs::DiagnosticArray> diagnostics{nh, "/diagnostics"};
};

TEST_F(SimulatedTime, thatHasNotBegunStopsNothing) {
  ASSERT_TRUE(ros::Time::now().isZero());
  ASSERT_TRUE(camera.camera.waitForChain(refined));
  expectFrames(0);
  expectDiagnostics();
}

TEST_F(SimulatedTime, thatJumpsOrStandsStillStopsNothing) {
  ros::Publisher clock = nh.advertise<rosgraph_msgs::Clock>("/clock", 10);
  ASSERT_TRUE(camera.camera.waitForChain(refined));
  constexpr int HOUR = 36000;  // frames
  // Ahead, an hour back, almost to the beginning of time, the same time once more, and ahead again.
  for (const int first : {2 * HOUR, HOUR, 1, 1, 3 * HOUR}) {
    rosgraph_msgs::Clock time;
    time.clock = StereoCamera::stamp(first);
    EXPECT_TRUE(waitFor([&] {
      clock.publish(time);
      return ros::Time::now() == time.clock;
    }));
    expectFrames(first);
    expectDiagnostics();
    refined.clear();
  }
}

TEST_F(SimulatedTime, ofABagInALoopBringsItsFramesInEveryLoop) {
  constexpr int FRAMES = KnownCamera::CONTENTS, LOOPS = 3;
  const TemporaryFolder folder;
  const std::string file = (folder / "loop.bag").string();
  {
    rosbag::Bag bag(file, rosbag::bagmode::Write);
    for (int i = 0; i < FRAMES; ++i) {
      const StereoMessages messages = camera.make(i);
      const ros::Time& time = messages.left->header.stamp;
      bag.write("/stereo/left/camera_info", time, messages.left_info);
      bag.write("/stereo/right/camera_info", time, messages.right_info);
      bag.write("/stereo/left/image_rect", time, messages.left);
      bag.write("/stereo/right/image_rect", time, messages.right);
    }
  }
  const ChildProcess play({"rosrun", "rosbag", "play", "--clock", "--loop", "--quiet", "--rate=0.5", file});

  // Whole loops without the two frames that a jump may cost. A machine that stands still for a while may
  // break a loop, a chain that stands still after the first brings none.
  const auto countWholeLoops = [this] {
    int loops = -1, frames = 0;  // where the first one begins is not known
    ros::Time last = ros::TIME_MAX;
    for (const auto& message : refined.all()) {
      if (message->header.stamp <= last) {
        if (frames >= FRAMES - 2) ++loops;
        frames = 0;
      }
      ++frames;
      last = message->header.stamp;
    }
    return loops;
  };
  EXPECT_TRUE(waitFor([&] { return countWholeLoops() >= LOOPS; }, 60.0)) << countWholeLoops() << " loops";
  EXPECT_EQ(camera.countWrongPairs(refined), 0);
  expectDiagnostics();
}

}  // namespace
}  // namespace disparity_refinement
