#include <gtest/gtest.h>

#include <vector>

#include "disparity_refinement/ros/PlaneMarkers.hpp"

namespace disparity_refinement {
namespace {

using visualization_msgs::Marker;

cv::Point3d pointOf(const geometry_msgs::Point& point) { return {point.x, point.y, point.z}; }

PlanePatch patchAt(double z, const cv::Vec3d& normal) {
  PlanePatch patch;
  patch.centre = {0, 0, z};
  patch.normal = normal;
  for (std::size_t i = 0; i < patch.corners.size(); ++i)
    patch.corners[i] = {0.1 * static_cast<double>(i), 1, z};
  return patch;
}

TEST(PlaneMarkers, areTrianglesAndNormals) {
  std_msgs::Header header;
  header.frame_id = "camera";
  header.stamp = ros::Time(3, 4);
  const std::vector<PlanePatch> patches = {patchAt(4, {0, -1, 0}), patchAt(8, {0, 0, -1})};
  const auto message = planeMarkers(header, patches);
  ASSERT_EQ(message->markers.size(), 2U);
  for (const Marker& marker : message->markers) {
    EXPECT_EQ(marker.header.frame_id, "camera");
    EXPECT_EQ(marker.header.stamp, header.stamp);
    EXPECT_EQ(marker.action, Marker::ADD);
    EXPECT_EQ(marker.pose.orientation.w, 1.0);
    EXPECT_EQ(marker.points.size(), marker.colors.size());
    EXPECT_EQ(marker.lifetime, ros::Duration(0)) << "until the next frame";
  }

  const Marker& triangles = message->markers[0];
  EXPECT_EQ(triangles.ns, "patches");
  EXPECT_EQ(triangles.type, Marker::TRIANGLE_LIST);
  EXPECT_EQ(triangles.scale.x, 1.0);
  EXPECT_EQ(triangles.scale.y, 1.0);
  EXPECT_EQ(triangles.scale.z, 1.0);
  ASSERT_EQ(triangles.points.size(), 2U * PlanePatch::CORNERS * 3U);
  for (std::size_t i = 0; i < triangles.points.size(); ++i) {
    const PlanePatch& patch = patches[i / (PlanePatch::CORNERS * 3)];
    const std::size_t corner = i / 3 % PlanePatch::CORNERS;
    const cv::Point3d expected = i % 3 == 0   ? patch.centre
                                 : i % 3 == 1 ? patch.corners[corner]
                                              : patch.corners[(corner + 1) % PlanePatch::CORNERS];
    EXPECT_EQ(pointOf(triangles.points[i]), expected) << i;
    EXPECT_EQ(triangles.colors[i].g, &patch == &patches[0] ? 1.0F : 0.0F) << "the road is green";
    EXPECT_EQ(triangles.colors[i].b, &patch == &patches[0] ? 0.0F : 1.0F) << "a front is blue";
    EXPECT_EQ(triangles.colors[i].r, 0.0F);
    EXPECT_GT(triangles.colors[i].a, 0.3F);
    EXPECT_LT(triangles.colors[i].a, 1.0F) << "the cloud is seen through it";
  }

  const Marker& lines = message->markers[1];
  EXPECT_EQ(lines.ns, "normals");
  EXPECT_EQ(lines.type, Marker::LINE_LIST);
  EXPECT_GT(lines.scale.x, 0.0);
  ASSERT_EQ(lines.points.size(), 4U);
  EXPECT_EQ(pointOf(lines.points[0]), patches[0].centre);
  EXPECT_LT(cv::norm(pointOf(lines.points[1]) - cv::Point3d(0, -0.2, 4)), 1e-12) << "4 m away";
  EXPECT_EQ(pointOf(lines.points[2]), patches[1].centre);
  EXPECT_LT(cv::norm(pointOf(lines.points[3]) - cv::Point3d(0, 0, 7.6)), 1e-12) << "8 m away";
  EXPECT_EQ(lines.colors[0].g, 1.0F);
  EXPECT_EQ(lines.colors[3].b, 1.0F);
  EXPECT_EQ(lines.colors[3].a, 1.0F);
}

TEST(PlaneMarkers, replaceThoseOfTheFormerFrame) {
  const auto many = planeMarkers({}, {patchAt(4, {0, -1, 0}), patchAt(8, {0, 0, -1})});
  const auto none = planeMarkers({}, {});
  ASSERT_EQ(none->markers.size(), many->markers.size());
  for (std::size_t i = 0; i < many->markers.size(); ++i) {
    EXPECT_EQ(none->markers[i].ns, many->markers[i].ns);
    EXPECT_EQ(none->markers[i].id, many->markers[i].id);
    EXPECT_EQ(many->markers[i].action, Marker::ADD);
    EXPECT_EQ(none->markers[i].action, Marker::DELETE) << "rviz refuses a marker without points";
    EXPECT_TRUE(none->markers[i].points.empty());
  }
}

}  // namespace
}  // namespace disparity_refinement
