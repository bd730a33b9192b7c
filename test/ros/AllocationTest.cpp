// The test loads the nodelets into its own process, as a manager does, and counts what they allocate.

#include <gtest/gtest.h>
#include <nodelet/loader.h>
#include <stereo_msgs/DisparityImage.h>

#include <map>
#include <string>
#include <vector>

#include "../AllocationCounter.hpp"
#include "ChainClient.hpp"
#include "disparity_refinement/matching/StereoMatcher.hpp"

namespace disparity_refinement {
namespace {

constexpr int WARM_UP = 5, FRAMES = 10;
// A tenth of a gray image: everything that roscpp allocates for a frame is smaller.
constexpr std::size_t SMALLEST = 4096;

/// Allocations of OpenCV's matcher for one frame, which are not in our hands.
long allocationsOfMatcher(const std::vector<StereoMessages>& frames, int disparity_range) {
  MatchingParameters parameters;
  parameters.disparity_range = disparity_range;
  StereoMatcher matcher(parameters);
  cv::Mat disparity;
  const auto compute = [&](const StereoMessages& frame) {
    matcher.compute(imageView(*frame.left, sensor_msgs::image_encodings::MONO8, "left"),
                    imageView(*frame.right, sensor_msgs::image_encodings::MONO8, "right"), disparity);
  };
  for (int i = 0; i < WARM_UP; ++i) compute(frames[i]);
  startCounting(SMALLEST);
  for (int i = WARM_UP; i < WARM_UP + FRAMES; ++i) compute(frames[i]);
  return stopCounting().count;
}

TEST(Allocation, isThatOfTheOutgoingMessages) {
  if (!canCountAllocations()) GTEST_SKIP() << "a sanitizer has a malloc of its own";
  cv::setNumThreads(1);
  ros::NodeHandle nh;
  nodelet::Loader loader(nh);
  const std::map<std::string, std::string> remappings;
  const std::vector<std::string> arguments;
  for (const char* name : {"disparity", "segmentation", "plane_refinement"}) {
    ASSERT_TRUE(loader.load(std::string("/stereo/") + name, std::string("disparity_refinement/") + name,
                            remappings, arguments));
  }
  Listener<stereo_msgs::DisparityImage> refined(nh, "disparity_refined");
  StereoCamera camera(nh);
  ASSERT_TRUE(camera.waitForChain(refined));

  std::vector<StereoMessages> frames;
  for (int i = 0; i < WARM_UP + FRAMES; ++i) {
    // The images repeat: buffers grow with what is in them.
    const StreetFrame images = camera.street().render(i % WARM_UP);
    frames.push_back(camera.make(images.left, images.right, StereoCamera::stamp(i)));
  }
  const auto pass = [&](int i) {
    camera.publish(frames[i]);
    return refined.wait(frames[i].left->header.stamp) != nullptr;
  };
  for (int i = 0; i < WARM_UP; ++i) ASSERT_TRUE(pass(i));
  startCounting(SMALLEST);
  for (int i = WARM_UP; i < WARM_UP + FRAMES; ++i) ASSERT_TRUE(pass(i));
  const long count = stopCounting().count;

  // Data of labels, disparity and refined disparity.
  EXPECT_EQ(3 * FRAMES, count - allocationsOfMatcher(frames, 64));
}

}  // namespace
}  // namespace disparity_refinement
