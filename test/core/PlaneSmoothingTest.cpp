#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "PlaneScene.hpp"
#include "disparity_refinement/refinement/PlaneSmoothing.hpp"

namespace disparity_refinement {
namespace {

// Two segments side by side.
const int HEIGHT = 24, WIDTH = 40, MIDDLE = 20;
const double BORDER = MIDDLE - 0.5;

PlaneScene twoSegments() {
  PlaneScene scene({WIDTH, HEIGHT});
  scene.labels.colRange(MIDDLE, WIDTH).setTo(1);
  return scene;
}

std::vector<DisparityPlane> smooth(const PlaneScene& scene, const PlaneSmoothingParameters& parameters = {}) {
  std::vector<DisparityPlane> planes = scene.planes;
  smoothPlanes(scene.segments, scene.graph, scene.support, parameters, planes);
  return planes;
}

double largestStep(const std::vector<DisparityPlane>& planes) {
  double largest = 0.0;
  for (int y = 0; y < HEIGHT; ++y) {
    largest = std::max(largest, std::abs(planes[0].at(BORDER, y) - planes[1].at(BORDER, y)));
  }
  return largest;
}

// Largest distance of two planes within columns of the image.
double distance(const DisparityPlane& a, const DisparityPlane& b, int first, int end) {
  double largest = 0.0;
  for (const int x : {first, end - 1}) {
    for (const int y : {0, HEIGHT - 1}) largest = std::max(largest, std::abs(a.at(x, y) - b.at(x, y)));
  }
  return largest;
}

void expectSame(const DisparityPlane& actual, const DisparityPlane& expected) {
  EXPECT_EQ(actual.is_known, expected.is_known);
  EXPECT_EQ(actual.a, expected.a);
  EXPECT_EQ(actual.b, expected.b);
  EXPECT_EQ(actual.c, expected.c);
}

TEST(PlaneSmoothing, joinsTwoFitsOfOnePlane) {
  const DisparityPlane plane{0.1, 0.2, 20.0, true};
  PlaneScene scene = twoSegments();
  scene.measure(0, plane);
  scene.measure(1, plane);
  scene.prepare();
  scene.planes = {{0.12, 0.19, 20.3, true}, {0.08, 0.22, 19.9, true}};
  const double before = largestStep(scene.planes);
  ASSERT_GT(before, 0.5);
  PlaneSmoothingParameters parameters;
  const auto planes = smooth(scene, parameters);
  EXPECT_LT(largestStep(planes), 0.05 * before);
  EXPECT_LT(distance(planes[0], plane, 0, MIDDLE), 0.05);
  EXPECT_LT(distance(planes[1], plane, MIDDLE, WIDTH), 0.05);
  parameters.sweeps = 30;
  EXPECT_LT(distance(smooth(scene, parameters)[0], plane, 0, MIDDLE), 1e-6);
}

TEST(PlaneSmoothing, joinsPlanesWithoutSupport) {
  // Nothing holds the two: they meet.
  PlaneScene scene = twoSegments();
  scene.prepare();
  scene.planes = {{0.0, 0.0, 20.0, true}, {0.0, 0.0, 21.0, true}};
  const auto planes = smooth(scene);
  EXPECT_LT(largestStep(planes), 0.05);
}

TEST(PlaneSmoothing, keepsAHinge) {
  const DisparityPlane road{0.0, 0.3, 20.0, true}, wall{0.25, 0.3, 20.0 - 0.25 * BORDER, true};
  PlaneScene scene = twoSegments();
  scene.measure(0, road);
  scene.measure(1, wall);
  scene.prepare();
  scene.planes = {road, wall};
  ASSERT_LT(largestStep(scene.planes), 1e-9);
  const auto exact = smooth(scene);
  EXPECT_LT(distance(exact[0], road, 0, MIDDLE), 1e-5);
  EXPECT_LT(distance(exact[1], wall, MIDDLE, WIDTH), 1e-5);

  // Fitted with errors.
  scene.planes = {{0.01, 0.31, 20.2, true}, {0.24, 0.29, 20.1 - 0.25 * BORDER, true}};
  const double before = largestStep(scene.planes);
  const auto planes = smooth(scene);
  EXPECT_LT(largestStep(planes), 0.1 * before);
  EXPECT_NEAR(planes[0].a, 0.0, 0.01);
  EXPECT_NEAR(planes[0].b, 0.3, 0.01);
  EXPECT_NEAR(planes[1].a, 0.25, 0.01);
  EXPECT_NEAR(planes[1].b, 0.3, 0.01);
}

TEST(PlaneSmoothing, keepsADepthStep) {
  const DisparityPlane low{0.1, 0.2, 20.0, true};
  DisparityPlane high = low;
  for (const double step : {3.0, 3.5, 40.0}) {
    high.c = low.c + step;
    for (const bool has_support : {false, true}) {
      PlaneScene scene = twoSegments();
      if (has_support) {
        scene.measure(0, low);
        scene.measure(1, high);
      }
      scene.prepare();
      scene.planes = {low, high};
      const auto planes = smooth(scene);
      const double tolerance = has_support ? 1e-5 : 1e-9;  // What was measured is in single precision.
      EXPECT_LT(distance(planes[0], low, 0, WIDTH), tolerance) << step;
      EXPECT_LT(distance(planes[1], high, 0, WIDTH), tolerance) << step;
    }
  }
  // A step is one surface up to max_step: the same planes move then.
  high.c = low.c + 3.0;
  PlaneScene scene = twoSegments();
  scene.prepare();
  scene.planes = {low, high};
  PlaneSmoothingParameters parameters;
  parameters.max_step = 6.0;
  EXPECT_LT(largestStep(smooth(scene, parameters)), 1.0);
}

TEST(PlaneSmoothing, countsSmallStepsMoreThanLargeOnes) {
  // Segment 1 lies between two planes that are held by what was measured.
  const DisparityPlane low{0.0, 0.0, 20.0, true}, high{0.0, 0.0, 22.9, true};
  PlaneScene scene({60, HEIGHT});
  for (int i = 0; i < 3; ++i) scene.labels.colRange(i * 20, (i + 1) * 20).setTo(i);
  scene.measure(0, low);
  scene.measure(2, high);
  scene.prepare();
  scene.planes = {low, {0.0, 0.0, 20.5, true}, high};
  PlaneSmoothingParameters parameters;
  parameters.sweeps = 20;
  const auto planes = smooth(scene, parameters);
  EXPECT_NEAR(planes[1].at(19.5, 12.0), 20.0, 0.1);
}

TEST(PlaneSmoothing, ignoresWhatWasMeasuredFarFromThePlane) {
  const DisparityPlane plane{0.1, 0.2, 20.0, true};
  PlaneScene scene({WIDTH, HEIGHT});
  scene.measure(0, plane);
  scene.measured(cv::Rect(0, 0, 10, HEIGHT)) += cv::Scalar(1.6);
  scene.prepare();
  scene.planes = {plane};
  EXPECT_LT(distance(smooth(scene)[0], plane, 0, WIDTH), 1e-5);
  PlaneSmoothingParameters parameters;
  parameters.inlier_threshold = 1.7;
  EXPECT_GT(distance(smooth(scene, parameters)[0], plane, 0, WIDTH), 0.5);
}

TEST(PlaneSmoothing, fitsAPlaneToWhatWasMeasured) {
  const DisparityPlane plane{0.1, 0.2, 20.0, true};
  PlaneScene scene({WIDTH, HEIGHT});
  scene.measure(0, plane);
  scene.prepare();
  scene.planes = {{0.11, 0.19, 20.3, true}};
  PlaneSmoothingParameters parameters;
  parameters.sweeps = 1;
  // The plane as it was counts a little.
  const double before = distance(scene.planes[0], plane, 0, WIDTH);
  const double once = distance(smooth(scene, parameters)[0], plane, 0, WIDTH);
  EXPECT_GT(once, 1e-4);
  EXPECT_LT(once, 0.2 * before);
  parameters.sweeps = 20;
  EXPECT_LT(distance(smooth(scene, parameters)[0], plane, 0, WIDTH), 1e-5);
}

TEST(PlaneSmoothing, weighsTheBorderByItsContrast) {
  const DisparityPlane low{0.0, 0.0, 20.0, true}, high{0.0, 0.0, 21.0, true};
  const auto stepAt = [&](int gray, double border_weight) {
    PlaneScene scene = twoSegments();
    scene.measure(0, low);
    scene.measure(1, high);
    scene.gray.colRange(MIDDLE, WIDTH).setTo(gray);
    scene.prepare();
    scene.planes = {low, high};
    PlaneSmoothingParameters parameters;
    parameters.border_weight = border_weight;
    return largestStep(smooth(scene, parameters));
  };
  EXPECT_LT(stepAt(100, 3.0), stepAt(120, 3.0));
  EXPECT_LT(stepAt(120, 3.0), stepAt(200, 3.0));
  EXPECT_LT(stepAt(100, 10.0), stepAt(100, 3.0));
  EXPECT_NEAR(stepAt(100, 0.0), 1.0, 1e-5);
  // Half the weight by contrast is half the weight.
  EXPECT_DOUBLE_EQ(stepAt(110, 6.0), stepAt(100, 3.0));
}

TEST(PlaneSmoothing, changesNothingWithoutSweeps) {
  PlaneScene scene = twoSegments();
  scene.measured.setTo(20.5F);
  scene.prepare();
  scene.planes = {{0.0, 0.0, 20.0, true}, {0.0, 0.01, 21.0, true}};
  PlaneSmoothingParameters parameters;
  parameters.sweeps = 0;
  const auto planes = smooth(scene, parameters);
  expectSame(planes[0], scene.planes[0]);
  expectSame(planes[1], scene.planes[1]);
}

TEST(PlaneSmoothing, leavesWhatIsUnknown) {
  PlaneScene scene = twoSegments();
  scene.measured.setTo(20.0F);
  scene.prepare();
  scene.planes = {DisparityPlane(), {0.0, 0.0, 20.0, true}};
  const auto planes = smooth(scene);
  expectSame(planes[0], DisparityPlane());
  EXPECT_LT(distance(planes[1], scene.planes[1], MIDDLE, WIDTH), 1e-9);
}

TEST(PlaneSmoothing, isRegularForSegmentsOnALine) {
  // All points of these segments, and of their borders, lie on lines.
  for (const cv::Size size : {cv::Size(12, 1), cv::Size(1, 12), cv::Size(2, 1)}) {
    PlaneScene scene(size);
    scene.labels(cv::Rect(0, 0, (size.width + 1) / 2, (size.height + 1) / 2)).setTo(1);
    scene.measured.setTo(20.0F);
    scene.prepare();
    for (DisparityPlane& plane : scene.planes) plane = {0.0, 0.0, 20.5, true};
    const auto planes = smooth(scene);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const DisparityPlane& plane = planes[scene.labels.at<int>(y, x)];
        EXPECT_TRUE(plane.is_known);
        EXPECT_GT(plane.at(x, y), 19.9) << size;
        EXPECT_LT(plane.at(x, y), 20.5) << size;
      }
    }
  }
}

TEST(PlaneSmoothing, isExactFarFromTheOrigin) {
  PlaneScene scene({2000, 8});
  scene.labels.setTo(-1);
  scene.labels.colRange(1990, 2000).setTo(0);
  const DisparityPlane plane{0.5, 0.25, -950.0, true};
  scene.measure(0, plane);
  scene.prepare();
  scene.planes = {plane};
  const DisparityPlane smoothed = smooth(scene)[0];
  EXPECT_NEAR(smoothed.a, plane.a, 1e-9);
  EXPECT_NEAR(smoothed.b, plane.b, 1e-9);
  EXPECT_NEAR(smoothed.at(1995, 4), plane.at(1995, 4), 1e-9);
}

}  // namespace
}  // namespace disparity_refinement
