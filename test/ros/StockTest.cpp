// Nodelets of stereo_image_proc before and behind ours.

#include <gtest/gtest.h>
#include <sensor_msgs/PointCloud2.h>
#include <sensor_msgs/point_cloud2_iterator.h>
#include <stereo_msgs/DisparityImage.h>

#include <algorithm>
#include <cmath>

#include "ChainClient.hpp"
#include "disparity_refinement/refinement/PlaneRefinement.hpp"

namespace disparity_refinement {
namespace {

namespace enc = sensor_msgs::image_encodings;
using sensor_msgs::Image;
using sensor_msgs::PointCloud2;
using stereo_msgs::DisparityImage;

TEST(Upstream, stockDisparityIsRefinedAsByTheCore) {
  ros::NodeHandle nh("/upstream");
  StereoCamera camera(nh);
  Listener<DisparityImage> raw(nh, "disparity"), refined(nh, "disparity_refined");
  Listener<Image> labels(nh, "labels");
  ASSERT_TRUE(camera.waitForChain(refined));
  for (int i = 0; i < 3; ++i) {
    const ros::Time stamp = camera.publish(i);
    const auto raw_message = raw.wait(stamp);
    const auto labels_message = labels.wait(stamp);
    const auto refined_message = refined.wait(stamp);
    ASSERT_TRUE(raw_message && labels_message && refined_message) << "frame " << i;

    const cv::Mat disparity = imageView(raw_message->image, enc::TYPE_32FC1, "disparity");
    double largest = 0.0;
    cv::minMaxLoc(disparity, nullptr, &largest);
    ASSERT_EQ(raw_message->max_disparity, 63.0F) << "stock publishes the last whole disparity";
    DisparityRange range;
    range.min = raw_message->min_disparity;
    range.max = largest > 63.0 ? 64.0F : 63.0F;
    PlaneRefinement refinement;
    cv::Mat expected;
    refinement.refine(disparity, imageView(*labels_message, enc::TYPE_32SC1, "labels"), range,
                      static_cast<double>(raw_message->f) * raw_message->T, PlaneRefinementParameters(),
                      expected);

    const cv::Mat map = imageView(refined_message->image, enc::TYPE_32FC1, "disparity_refined");
    EXPECT_EQ(cv::norm(map, expected, cv::NORM_INF), 0.0) << "frame " << i;
    EXPECT_EQ(refined_message->header.frame_id, "stereo_left");
    EXPECT_EQ(refined_message->f, raw_message->f);
    EXPECT_EQ(refined_message->T, raw_message->T);
    EXPECT_EQ(refined_message->min_disparity, range.min);
    EXPECT_EQ(refined_message->max_disparity, range.max);
    EXPECT_GT(refined_message->delta_d, 0.0F);
    // Stock computes its window from a width of 0.
    EXPECT_LE(refined_message->valid_window.width, 320U);
    EXPECT_LE(refined_message->valid_window.height, 120U);
    EXPECT_GT(cv::countNonZero(map >= range.min), cv::countNonZero(disparity >= range.min))
        << "the refinement fills nothing: the test says little";
  }
}

/// A point for every disparity above 0, at its depth, and for no other pixel.
void expectCloud(const PointCloud2& cloud, const DisparityImage& message) {
  EXPECT_EQ(cloud.header.stamp, message.header.stamp);
  EXPECT_EQ(cloud.header.frame_id, message.header.frame_id);
  ASSERT_EQ(cloud.width, message.image.width);
  ASSERT_EQ(cloud.height, message.image.height);
  const cv::Mat map = imageView(message.image, enc::TYPE_32FC1, "disparity_refined");
  sensor_msgs::PointCloud2ConstIterator<float> z(cloud, "z");
  float farthest = 0.0F, smallest = message.max_disparity;
  int points = 0;
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x, ++z) {
      const float d = map.at<float>(y, x);
      if (d > 0.0F) {
        const float expected = message.f * message.T / d;
        ASSERT_NEAR(*z, expected, 1e-4F * expected) << "d = " << d << " at " << x << ", " << y;
        farthest = std::max(farthest, *z);
        smallest = std::min(smallest, d);
        ++points;
      } else {
        ASSERT_TRUE(std::isnan(*z)) << *z << " for d = " << d << " at " << x << ", " << y;
      }
    }
  }
  ASSERT_GT(points, map.rows * map.cols / 4);
  EXPECT_NEAR(farthest, message.f * message.T / smallest, 1e-4F * farthest) << "the farthest surface is lost";
}

TEST(Downstream, stockPointCloudHasEveryRefinedDisparity) {
  ros::NodeHandle nh("/downstream");
  StereoCamera camera(nh);
  Listener<DisparityImage> refined(nh, "disparity_refined");
  Listener<PointCloud2> cloud(nh, "points2");
  ASSERT_TRUE(camera.waitForChain(cloud));
  ASSERT_TRUE(camera.waitForChain(refined));
  for (int i = 0; i < 3; ++i) {
    const ros::Time stamp = camera.publish(i);
    const auto refined_message = refined.wait(stamp);
    const auto cloud_message = cloud.wait(stamp);
    ASSERT_TRUE(refined_message && cloud_message) << "frame " << i;
    expectCloud(*cloud_message, *refined_message);
  }
}

TEST(Downstream, stockPointCloudKeepsTheFarthestSurfaceOfAMapWithoutHoles) {
  ros::NodeHandle nh("/dense");
  StereoCamera camera(nh);
  ros::Publisher disparity = nh.advertise<DisparityImage>("disparity", 10);
  ros::Publisher labels = nh.advertise<Image>("labels", 10);
  Listener<DisparityImage> refined(nh, "disparity_refined");
  Listener<PointCloud2> cloud(nh, "points2");

  // A wall at 25 m behind one at 5 m: f * T = 100 px m.
  constexpr float FAR = 4.0F, NEAR = 20.0F;
  const StreetFrame frame = camera.street().render(0);
  const cv::Size size = frame.left.size();
  const cv::Rect wall(100, 30, 80, 60);
  const auto publish = [&](int index) {
    const StereoMessages messages = camera.make(frame.left, frame.right, StereoCamera::stamp(index));
    StereoGeometry geometry;
    geometry.focal_length = 200.0;
    geometry.baseline = 0.5;
    DisparityRange range;
    range.max = 64.0F;
    const auto map =
        makeDisparityImage(messages.left->header, size, geometry, range, cv::Rect(cv::Point(), size));
    const auto segments = makeImage(messages.left->header, size, enc::TYPE_32SC1);
    cv::Mat d = imageView(map->image, enc::TYPE_32FC1, "disparity");
    d = FAR;
    d(wall) = NEAR;
    imageView(*segments, enc::TYPE_32SC1, "labels")(wall) = 1;
    camera.publish(messages);
    disparity.publish(map);
    labels.publish(segments);
  };
  int index = 0;
  ASSERT_TRUE(waitFor([&] {
    publish(index++);
    return cloud.wait([](const PointCloud2&) { return true; }, 0.3) != nullptr &&
           refined.wait([](const DisparityImage&) { return true; }, 0.3) != nullptr;
  }));

  publish(index);
  const auto refined_message = refined.wait(StereoCamera::stamp(index));
  const auto cloud_message = cloud.wait(StereoCamera::stamp(index));
  ASSERT_TRUE(refined_message && cloud_message);
  const cv::Mat map = imageView(refined_message->image, enc::TYPE_32FC1, "disparity_refined");
  EXPECT_EQ(cv::countNonZero(map == FAR), size.area() - wall.area() - 1);
  EXPECT_EQ(cv::countNonZero(map == NEAR), wall.area());
  expectCloud(*cloud_message, *refined_message);
}

}  // namespace
}  // namespace disparity_refinement
