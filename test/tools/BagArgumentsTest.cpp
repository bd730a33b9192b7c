#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <cstdint>
#include <string>
#include <vector>

#include "BagArguments.hpp"
#include "KittiFixture.hpp"

namespace disparity_refinement {
namespace {

sensor_msgs::Image image(const ros::Time& stamp, const std::string& frame_id = "camera") {
  sensor_msgs::Image message;
  message.header.stamp = stamp;
  message.header.frame_id = frame_id;
  return message;
}

/// A bag with the CameraInfos of /rig/left and /rig/right and one image of each.
std::string writtenBag(const TemporaryFolder& folder, const sensor_msgs::Image& left,
                       const sensor_msgs::Image& right) {
  std::string file = (folder / "rig.bag").string();
  rosbag::Bag bag(file, rosbag::bagmode::Write);
  for (const std::string side : {"left", "right"}) {
    bag.write("/rig/" + side + "/camera_info", ros::Time(1), sensor_msgs::CameraInfo());
    bag.write("/rig/" + side + "/image_rect", ros::Time(1), side == "left" ? left : right);
  }
  return file;
}

using Texts = std::vector<std::string>;

TEST(BagArguments, areThoseOfTheLaunchFile) {
  const TemporaryFolder folder;
  const Texts exact = {"namespace:=/rig", "left:=/rig/left", "right:=/rig/right", "image:=image_rect",
                       "camera_frame:=camera"};
  EXPECT_EQ(bagArguments(writtenBag(folder, image({5, 0}), image({5, 0}))), exact);
  Texts approximate = exact;
  approximate.push_back("approximate_sync:=true");
  approximate.push_back("approximate_sync_max_interval:=0.040000");
  EXPECT_EQ(bagArguments(writtenBag(folder, image({5, 0}), image({5, 20000000}))), approximate);
  // One nanosecond is not exact either.
  approximate.back() = "approximate_sync_max_interval:=0.010000";
  EXPECT_EQ(bagArguments(writtenBag(folder, image({1600000000, 1}), image({1600000000, 0}))), approximate);
}

TEST(BagArguments, mayHaveStampsFarApart) {
  const TemporaryFolder folder;
  const Texts arguments = bagArguments(writtenBag(folder, image({0, 0}), image({4000000000U, 0})));
  EXPECT_EQ(arguments.back(), "approximate_sync_max_interval:=8000000000.000000");
}

TEST(BagArguments, stayOneLineEach) {
  const TemporaryFolder folder;
  const std::string file = writtenBag(folder, image({5, 0}, "camera\nrviz:=true"), image({5, 0}));
  const std::string text = refusal([&] { bagArguments(file); });
  EXPECT_EQ(text.find(file + ": camera_frame"), 0U) << text;
}

TEST(BagArguments, nameTheFileThatHasNone) {
  const TemporaryFolder folder;
  for (const std::string name : {"none.bag", "text.bag", "empty.bag"}) {
    const std::string file = (folder / name).string();
    if (name == "text.bag") writeText(file, "no bag");
    if (name == "empty.bag") rosbag::Bag(file, rosbag::bagmode::Write).close();
    const std::string text = refusal([&] { bagArguments(file); });
    EXPECT_NE(text.find(file), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace disparity_refinement
