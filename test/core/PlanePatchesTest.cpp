#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "disparity_refinement/evaluation/SyntheticStreet.hpp"
#include "disparity_refinement/visualization/PlanePatches.hpp"

namespace disparity_refinement {
namespace {

const StereoGeometry GEOMETRY{400.0, 0.5, 0.0};
const cv::Point2d PRINCIPAL_POINT(310.5, 122.25);

/// Distance along the ray of a pixel to the plane normal . P = distance, as depth Z.
double depthAt(const cv::Vec3d& normal, double distance, double x, double y) {
  const cv::Vec3d ray((x - PRINCIPAL_POINT.x) / GEOMETRY.focal_length,
                      (y - PRINCIPAL_POINT.y) / GEOMETRY.focal_length, 1.0);
  return distance / normal.dot(ray);
}

/// The plane of disparities that a plane in space gives: through those of three pixels.
SegmentPlane seenPlane(const cv::Vec3d& normal, double distance) {
  const auto disparity = [&](double x, double y) {
    return GEOMETRY.focal_length * GEOMETRY.baseline / depthAt(normal, distance, x, y);
  };
  SegmentPlane plane;
  plane.status = PlaneStatus::ACCEPTED;
  plane.c = disparity(0, 0);
  plane.a = (disparity(100, 0) - plane.c) / 100;
  plane.b = (disparity(0, 100) - plane.c) / 100;
  return plane;
}

cv::Vec3d vector(const cv::Point3d& point) { return {point.x, point.y, point.z}; }

double distance(const cv::Vec3d& a, const cv::Vec3d& b) { return cv::norm(a - b); }

cv::Mat oneSegment(const cv::Rect& rect) {
  cv::Mat labels(240, 640, CV_32SC1, cv::Scalar(-1));
  labels(rect).setTo(0);
  return labels;
}

struct Surface {
  std::string name;
  cv::Vec3d normal;  // Towards the camera; the plane is normal . P = -distance.
  double distance;
  cv::Vec3b colour;
};

class PlanePatches : public testing::TestWithParam<Surface> {};

TEST_P(PlanePatches, lieOnThePlaneInSpaceAndFaceTheCamera) {
  const cv::Vec3d normal = GetParam().normal / cv::norm(GetParam().normal);
  // Of a plane that is seen in the lower right of the image.
  const cv::Mat labels = oneSegment({400, 150, 101, 51});
  const SegmentPlane plane = seenPlane(-normal, GetParam().distance);
  const auto patches = findPlanePatches(labels, {plane}, GEOMETRY, PRINCIPAL_POINT);
  ASSERT_EQ(patches.size(), 1U);
  const PlanePatch& patch = patches[0];
  EXPECT_EQ(patch.label, 0);
  EXPECT_LT(distance(patch.normal, normal), 1e-9);
  EXPECT_EQ(normalColour(patch.normal), GetParam().colour);

  // The centre is where the ray of the centroid, pixel (450, 175), meets the plane.
  const double z = depthAt(-normal, GetParam().distance, 450, 175);
  EXPECT_GT(z, 0.0);
  const cv::Vec3d seen((450 - PRINCIPAL_POINT.x) / 400 * z, (175 - PRINCIPAL_POINT.y) / 400 * z, z);
  EXPECT_LT(distance(vector(patch.centre), seen), 1e-9 * z);
  for (const cv::Point3d& corner : patch.corners) {
    EXPECT_NEAR(normal.dot(vector(corner)), -GetParam().distance, 1e-9 * z);
    EXPECT_GT(corner.z, 0.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Surfaces, PlanePatches,
                         testing::Values(Surface{"road", {0, -1, 0}, 1.5, {0, 255, 0}},
                                         Surface{"wallOnTheRight", {-1, 0, 0}, 4.0, {0, 0, 255}},
                                         Surface{"front", {0, 0, -1}, 12.0, {255, 0, 0}},
                                         Surface{"slope", {-1, -1, 0}, 3.0, {0, 255, 255}}),
                         [](const auto& surface) { return surface.param.name; });

TEST(PlanePatch, isAnEllipseOfHalfTheExtent) {
  // Where the disparity is the same everywhere, space is an image: 1 px is 0.01 m here.
  SegmentPlane front;
  front.status = PlaneStatus::ACCEPTED;
  front.c = 50.0;
  // A rectangle has standard deviations of its sides by sqrt(12).
  const auto patches = findPlanePatches(oneSegment({100, 50, 120, 40}), {front}, GEOMETRY, PRINCIPAL_POINT);
  ASSERT_EQ(patches.size(), 1U);
  EXPECT_DOUBLE_EQ(patches[0].centre.z, 4.0);
  double left = 0.0, right = 0.0, top = 0.0, bottom = 0.0;
  for (const cv::Point3d& corner : patches[0].corners) {
    const cv::Point3d offset = corner - patches[0].centre;
    const double u = offset.x / (1.2 / std::sqrt(12.0)), v = offset.y / (0.4 / std::sqrt(12.0));
    EXPECT_NEAR(u * u + v * v, 1.0, 1e-9);
    left = std::min(left, u);
    right = std::max(right, u);
    top = std::min(top, v);
    bottom = std::max(bottom, v);
  }
  for (const double reach : {-left, right, -top, bottom}) EXPECT_NEAR(reach, 1.0, 1e-9);
}

TEST(PlanePatch, followsTheDirectionOfItsSegment) {
  SegmentPlane front;
  front.status = PlaneStatus::ACCEPTED;
  front.c = 50.0;
  cv::Mat labels(240, 640, CV_32SC1, cv::Scalar(-1));
  for (int i = 0; i < 100; ++i) labels(cv::Rect(200 + i, 50 + i, 4, 1)).setTo(0);
  const auto patches = findPlanePatches(labels, {front}, GEOMETRY, PRINCIPAL_POINT);
  ASSERT_EQ(patches.size(), 1U);
  double along = 0.0, across = 0.0;
  for (const cv::Point3d& corner : patches[0].corners) {
    const cv::Point3d offset = corner - patches[0].centre;
    along = std::max(along, std::abs(offset.x + offset.y));
    across = std::max(across, std::abs(offset.x - offset.y));
  }
  EXPECT_GT(along, 10 * across);
}

TEST(PlanePatches, areThoseOfSegmentsThatHaveAPlaneAndAreLargeEnough) {
  cv::Mat labels(100, 100, CV_32SC1, cv::Scalar(-1));
  std::vector<SegmentPlane> planes(8);
  const PlaneStatus statuses[] = {PlaneStatus::ACCEPTED,     PlaneStatus::TOO_FEW_POINTS,
                                  PlaneStatus::DEGENERATE,   PlaneStatus::MAX_ITERATIONS,
                                  PlaneStatus::OF_NEIGHBOUR, PlaneStatus::ACCEPTED,
                                  PlaneStatus::ACCEPTED,     PlaneStatus::ACCEPTED};
  for (int label = 0; label < 8; ++label) {
    labels(cv::Rect(0, 10 * label, 10, 10)).setTo(label);
    planes[label].status = statuses[label];
    planes[label].c = 20.0;
  }
  static_assert(MIN_PATCH_PIXELS == 100, "the squares have this size");
  labels.at<int>(55, 5) = -1;         // Label 5 has one pixel less,
  labels.rowRange(60, 70).setTo(-1);  // label 6 has none.
  const auto patches = findPlanePatches(labels, planes, GEOMETRY, PRINCIPAL_POINT);
  ASSERT_EQ(patches.size(), 3U);
  EXPECT_EQ(patches[0].label, 0);
  EXPECT_EQ(patches[1].label, 4);
  EXPECT_EQ(patches[2].label, 7);
}

TEST(PlanePatches, endBeforeTheHorizon) {
  // d = T / h (y - cy): 0 at row 122.25, 1 px at row 125.25. The ellipse of 20 rows reaches 5.8 px up.
  const SegmentPlane road = seenPlane({0, 1, 0}, 1.5);
  const auto count = [&road](int first_row) {
    return findPlanePatches(oneSegment({100, first_row, 80, 20}), {road}, GEOMETRY, PRINCIPAL_POINT).size();
  };
  EXPECT_EQ(count(122), 1U) << "up to row 125.7";
  EXPECT_EQ(count(121), 0U) << "up to row 124.7";
  EXPECT_EQ(count(80), 0U) << "above the horizon";
}

TEST(PlanePatches, leaveOutWhatIsNoPlane) {
  SegmentPlane plane;
  plane.status = PlaneStatus::ACCEPTED;
  const cv::Mat labels = oneSegment({100, 100, 50, 50});
  EXPECT_TRUE(findPlanePatches(labels, {plane}, GEOMETRY, PRINCIPAL_POINT).empty());
  plane.c = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(findPlanePatches(labels, {plane}, GEOMETRY, PRINCIPAL_POINT).empty());
  plane.c = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(findPlanePatches(labels, {plane}, GEOMETRY, PRINCIPAL_POINT).empty());
}

TEST(PlanePatches, areFinite) {
  SegmentPlane plane;
  plane.status = PlaneStatus::ACCEPTED;
  plane.c = 10.0;
  const cv::Mat labels = oneSegment({100, 100, 50, 50});
  EXPECT_EQ(findPlanePatches(labels, {plane}, GEOMETRY, PRINCIPAL_POINT).size(), 1U);
  EXPECT_TRUE(findPlanePatches(labels, {plane}, GEOMETRY, {1e300, 0.0}).empty());
  plane.a = 1e200;
  EXPECT_TRUE(findPlanePatches(labels, {plane}, GEOMETRY, PRINCIPAL_POINT).empty());
}

TEST(PlanePatches, findTheRoadOfTheStreet) {
  const SyntheticStreet street;
  const StreetParameters& parameters = street.parameters();
  const cv::Mat truth = street.render(0).disparity;
  // The road before the car, fitted by two rows of the ground truth.
  const int x = parameters.width / 2, top = parameters.height - 60, bottom = parameters.height - 10;
  SegmentPlane plane;
  plane.status = PlaneStatus::ACCEPTED;
  plane.b = (truth.at<float>(bottom, x) - truth.at<float>(top, x)) / (bottom - top);
  plane.c = truth.at<float>(top, x) - plane.b * top;
  const auto patches =
      findPlanePatches(oneSegment({x - 20, top, 40, bottom - top}), {plane},
                       {parameters.focal_length, parameters.baseline, 0.0}, street.principalPoint());
  ASSERT_EQ(patches.size(), 1U);
  EXPECT_NEAR(patches[0].centre.y, SyntheticStreet::CAMERA_HEIGHT, 1e-3);
  EXPECT_LT(distance(patches[0].normal, {0, -1, 0}), 1e-3);
}

TEST(PlanePatches, refuseBadLabels) {
  const std::vector<SegmentPlane> planes(2);
  const cv::Mat labels = (cv::Mat_<int>(1, 3) << -1, 1, 2);
  EXPECT_TRUE(findPlanePatches(labels.colRange(0, 2), planes, GEOMETRY, PRINCIPAL_POINT).empty());
  try {
    findPlanePatches(labels, planes, GEOMETRY, PRINCIPAL_POINT);
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "the largest label is 2, expected less than the number of planes, 2");
  }
  EXPECT_THROW(findPlanePatches(cv::Mat(3, 4, CV_8UC1, cv::Scalar(0)), planes, GEOMETRY, PRINCIPAL_POINT),
               std::invalid_argument);
  EXPECT_THROW(findPlanePatches(cv::Mat(), planes, GEOMETRY, PRINCIPAL_POINT), std::invalid_argument);
}

TEST(NormalColour, isThatOfTheAxisWhateverTheSide) {
  EXPECT_EQ(normalColour({1, 0, 0}), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(normalColour({-1, 0, 0}), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(normalColour({0, -1, 0}), cv::Vec3b(0, 255, 0));
  EXPECT_EQ(normalColour({0, 0, -1}), cv::Vec3b(255, 0, 0));
  EXPECT_EQ(normalColour({-0.8, 0.6, 0}), cv::Vec3b(0, 191, 255));
  EXPECT_EQ(normalColour({0, 0, 0}), cv::Vec3b(0, 0, 0));
}

}  // namespace
}  // namespace disparity_refinement
