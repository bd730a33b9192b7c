// The matching waits for the refinement: here the test says when that is done.

#include <gtest/gtest.h>
#include <nodelet/loader.h>
#include <std_msgs/Header.h>
#include <stereo_msgs/DisparityImage.h>

#include <chrono>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "ChainClient.hpp"

namespace disparity_refinement {
namespace {

using stereo_msgs::DisparityImage;

const std::map<std::string, std::string> NO_REMAPPINGS;
const std::vector<std::string> NO_ARGUMENTS;

void load(nodelet::Loader& loader, const std::string& nodelet) {
  ASSERT_TRUE(
      loader.load("/stereo/" + nodelet, "disparity_refinement/" + nodelet, NO_REMAPPINGS, NO_ARGUMENTS))
      << nodelet;
}

TEST(FlowControlChain, matchingWaitsUntilTheRefinementIsDone) {
  ros::NodeHandle nh("/stereo");
  nodelet::Loader loader(nh);
  load(loader, "disparity");
  StereoCamera camera(nh);
  ros::Publisher done = nh.advertise<std_msgs::Header>("refinement_done", 10);
  const auto answer = [&done](int index) {
    std_msgs::Header header;
    header.stamp = StereoCamera::stamp(index);
    done.publish(header);
  };
  Listener<DisparityImage> disparity(nh, "disparity");
  ASSERT_TRUE(camera.waitForChain(disparity));
  ASSERT_TRUE(waitFor([&done] { return done.getNumSubscribers() > 0; }));

  for (int i = 0; i < 3; ++i) ASSERT_TRUE(disparity.wait(camera.publish(i))) << "nobody refines yet, " << i;
  // A slow refinement: the matching has patience with the next one.
  std::this_thread::sleep_for(std::chrono::seconds(4));
  answer(2);
  ASSERT_TRUE(disparity.wait(camera.publish(3)));
  for (int i = 4; i < 7; ++i) camera.publish(i);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_EQ(disparity.all().back()->header.stamp, StereoCamera::stamp(3)) << "frame 3 is not refined yet";
  answer(3);
  ASSERT_TRUE(disparity.wait(StereoCamera::stamp(6))) << "the newest of those that have waited";
  EXPECT_FALSE(disparity.wait(StereoCamera::stamp(4), 0.0));
  EXPECT_FALSE(disparity.wait(StereoCamera::stamp(5), 0.0));

  // No answer: the frame was lost on its way.
  EXPECT_TRUE(disparity.wait(camera.publish(7)));
  answer(7);
  EXPECT_TRUE(disparity.wait(camera.publish(8)));
  // Unloaded while it waits.
  camera.publish(9);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_TRUE(loader.unload("/stereo/disparity"));
}

TEST(FlowControlChain, refinementSaysWhenItIsDone) {
  ros::NodeHandle nh("/stereo");
  nodelet::Loader loader(nh);
  for (const std::string nodelet : {"disparity", "segmentation", "plane_refinement"}) load(loader, nodelet);
  StereoCamera camera(nh);
  Listener<std_msgs::Header> done(nh, "refinement_done");
  Listener<DisparityImage> refined(nh, "disparity_refined");
  ASSERT_TRUE(camera.waitForChain(refined));
  for (int i = 0; i < 5; ++i) {
    const ros::Time stamp = camera.publish(i);
    ASSERT_TRUE(refined.wait(stamp)) << i;
    EXPECT_TRUE(done.wait([&stamp](const std_msgs::Header& header) { return header.stamp == stamp; })) << i;
  }
}

}  // namespace
}  // namespace disparity_refinement
