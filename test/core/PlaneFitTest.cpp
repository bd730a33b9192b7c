#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "disparity_refinement/refinement/PlaneFit.hpp"

namespace disparity_refinement {
namespace {

const DisparityRange RANGE{0.0F, 128.0F};

// The fit to a map that is one segment.
SegmentPlane fit(const cv::Mat& disparity, const PlaneRefinementParameters& parameters = {},
                 std::uint64_t seed = 0) {
  SegmentRuns segments;
  segments.build(cv::Mat::zeros(disparity.size(), CV_32SC1));
  SegmentPoints points;
  return fitPlane(disparity, RANGE, segments[0], seed, parameters, points);
}

cv::Mat planeMap(int rows, int cols, double a, double b, double c) {
  cv::Mat map(rows, cols, CV_32FC1);
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < cols; ++x) map.at<float>(y, x) = static_cast<float>(a * x + b * y + c);
  }
  return map;
}

// Replaces a share of the pixels by values drawn from the whole range.
void addOutliers(cv::Mat& map, double share, cv::RNG& random) {
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      if (random.uniform(0.0, 1.0) < share) map.at<float>(y, x) = random.uniform(RANGE.min, RANGE.max);
    }
  }
}

// What a matcher makes of it: noise, and steps of 1/16 px.
void addNoise(cv::Mat& map, double deviation, cv::RNG& random) {
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      float& d = map.at<float>(y, x);
      d = static_cast<float>(std::round((d + random.gaussian(deviation)) * 16.0) / 16.0);
    }
  }
}

// Largest distance between two planes over a map.
double distance(const SegmentPlane& plane, double a, double b, double c, const cv::Size& size) {
  double largest = 0.0;
  for (const int x : {0, size.width - 1}) {
    for (const int y : {0, size.height - 1}) {
      largest = std::max(largest, std::abs((plane.a - a) * x + (plane.b - b) * y + (plane.c - c)));
    }
  }
  return largest;
}

TEST(SegmentPoints, areTheValidPixelsInRasterOrder) {
  // Runs of every length, with everything that is no disparity in them.
  const float nothing[] = {RANGE.invalid(), std::numeric_limits<float>::quiet_NaN(),
                           std::numeric_limits<float>::infinity(), -500.0F};
  cv::RNG random(23);
  SegmentPoints points;
  for (int trial = 0; trial < 200; ++trial) {
    cv::Mat map(random.uniform(1, 30), random.uniform(1, 30), CV_32FC1);
    const double share = random.uniform(0.0, 1.0);
    for (int y = 0; y < map.rows; ++y) {
      for (int x = 0; x < map.cols; ++x) {
        const bool is_valid = random.uniform(0.0, 1.0) < share;
        map.at<float>(y, x) = is_valid ? random.uniform(0.0F, 200.0F) : nothing[random.uniform(0, 4)];
      }
    }
    cv::Mat labels = cv::Mat::zeros(map.size(), CV_32SC1);
    labels.colRange(0, random.uniform(0, map.cols)).setTo(-1);
    SegmentRuns segments;
    segments.build(labels);
    points.gather(map, RANGE, segments[0]);

    EXPECT_EQ(points.pixels, cv::countNonZero(labels == 0));
    int n = 0;
    for (int y = 0; y < map.rows; ++y) {
      for (int x = 0; x < map.cols; ++x) {
        if (labels.at<int>(y, x) != 0 || !RANGE.isValid(map.at<float>(y, x))) continue;
        ASSERT_LT(n, points.size);
        EXPECT_EQ(points.origin_x + points.x[n], x);
        EXPECT_EQ(points.origin_y + points.y[n], y);
        EXPECT_EQ(points.d[n], map.at<float>(y, x));
        ++n;
      }
    }
    EXPECT_EQ(points.size, n);
    for (int i = 0; i < SegmentPoints::PADDING; ++i) EXPECT_TRUE(std::isnan(points.d[n + i]));
  }
}

TEST(PlaneFit, recoversAnExactPlane) {
  const cv::Mat map = planeMap(30, 40, 0.0625, 0.25, 20.0);
  const SegmentPlane plane = fit(map);
  EXPECT_EQ(plane.status, PlaneStatus::ACCEPTED);
  EXPECT_LT(distance(plane, 0.0625, 0.25, 20.0, map.size()), 1e-9);
  EXPECT_EQ(plane.pixels, 1200);
  EXPECT_EQ(plane.valid, 1200);
  EXPECT_EQ(plane.inliers, 1200);
}

TEST(PlaneFit, isTheLeastSquaresPlaneOfTheInliers) {
  cv::RNG random(3);
  cv::Mat map = planeMap(25, 31, -0.125, 0.5, 40.0);
  addNoise(map, 0.1, random);  // Far below the threshold of 1 px: all are inliers.
  map.at<float>(7, 9) = RANGE.invalid();
  const SegmentPlane plane = fit(map);
  ASSERT_EQ(plane.inliers, 25 * 31 - 1);

  cv::Mat points, values;
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      if (!RANGE.isValid(map.at<float>(y, x))) continue;
      points.push_back(cv::Mat((cv::Mat_<double>(1, 3) << x, y, 1)));
      values.push_back(static_cast<double>(map.at<float>(y, x)));
    }
  }
  cv::Mat solution;
  ASSERT_TRUE(cv::solve(points, values, solution, cv::DECOMP_SVD));
  EXPECT_NEAR(plane.a, solution.at<double>(0), 1e-9);
  EXPECT_NEAR(plane.b, solution.at<double>(1), 1e-9);
  EXPECT_NEAR(plane.c, solution.at<double>(2), 1e-9);
}

TEST(PlaneFit, isTheLeastSquaresPlaneOfALargeSegment) {
  // The disparities are no multiples of a power of two: sums in single precision alone would not do.
  cv::RNG random(19);
  cv::Mat map = planeMap(400, 1100, 0.03, -0.1, 70.0);
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) map.at<float>(y, x) += static_cast<float>(random.gaussian(0.1));
  }
  const SegmentPlane plane = fit(map);
  ASSERT_EQ(plane.inliers, 400 * 1100);
  cv::Matx33d normal = cv::Matx33d::zeros();
  cv::Vec3d right(0.0, 0.0, 0.0);
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      const cv::Vec3d point(x, y, 1.0);
      normal += point * point.t();
      right += map.at<float>(y, x) * point;
    }
  }
  const cv::Vec3d solution = normal.solve(right, cv::DECOMP_CHOLESKY);
  EXPECT_LT(distance(plane, solution[0], solution[1], solution[2], map.size()), 1e-5);
}

TEST(PlaneFit, recoversThePlaneBehindGrossOutliers) {
  for (const double share : {0.3, 0.4, 0.5}) {
    for (int seed = 1; seed <= 20; ++seed) {
      cv::RNG random(seed);
      cv::Mat map = planeMap(40, 60, 0.1, -0.2, 60.0);
      addNoise(map, 0.15, random);
      addOutliers(map, share, random);
      const SegmentPlane plane = fit(map, {}, seed);
      ASSERT_EQ(plane.status, PlaneStatus::ACCEPTED);
      EXPECT_LT(distance(plane, 0.1, -0.2, 60.0, map.size()), 0.2) << "share " << share << ", seed " << seed;
      EXPECT_NEAR(plane.inlierShare(), 1.0 - share, 0.06);
    }
  }
}

TEST(PlaneFit, recoversARoad) {
  cv::RNG random(7);
  cv::Mat map = planeMap(150, 600, 0.0, 0.33, 5.0);
  addNoise(map, 0.3, random);
  addOutliers(map, 0.2, random);
  const SegmentPlane plane = fit(map);
  EXPECT_NEAR(plane.a, 0.0, 1e-4);
  EXPECT_NEAR(plane.b, 0.33, 1e-3);
}

TEST(PlaneFit, countsCoordinatesFromTheCornerOfTheImage) {
  // The segment is the right half of the map.
  const cv::Mat map = planeMap(10, 2000, 0.03125, 0.5, 3.0);
  cv::Mat labels(map.size(), CV_32SC1, cv::Scalar(-1));
  labels.colRange(1000, 2000).setTo(0);
  SegmentRuns segments;
  segments.build(labels);
  SegmentPoints points;
  const SegmentPlane plane = fitPlane(map, RANGE, segments[0], 0, {}, points);
  EXPECT_EQ(plane.pixels, 10000);
  EXPECT_LT(distance(plane, 0.03125, 0.5, 3.0, map.size()), 1e-9);
}

TEST(PlaneFit, samplesPointsThatAreNotInStepWithTheShape) {
  // 4096 points: every sixteenth one would be in the same column, from which no slope along x can be known.
  const cv::Mat map = planeMap(256, 16, 0.5, 0.25, 1.0);
  const SegmentPlane plane = fit(map);
  ASSERT_EQ(plane.status, PlaneStatus::ACCEPTED);
  EXPECT_NEAR(plane.a, 0.5, 1e-9);
}

TEST(PlaneFit, acceptsAnInlierAtTheThresholdOnly) {
  PlaneRefinementParameters parameters;
  parameters.inlier_threshold = 1.0;
  // A pixel off the plane in the centre lifts the mean of 63 points, but tilts nothing.
  cv::Mat map = planeMap(9, 7, 0.0, 0.0, 10.0);
  map.at<float>(4, 3) = 11.0F;
  SegmentPlane plane = fit(map, parameters);
  EXPECT_EQ(plane.inliers, 63);
  EXPECT_NEAR(plane.c, 10.0 + 1.0 / 63.0, 1e-9);

  map.at<float>(4, 3) = std::nextafter(11.0F, 12.0F);
  plane = fit(map, parameters);
  EXPECT_EQ(plane.inliers, 62);
  EXPECT_EQ(plane.valid, 63);
  EXPECT_NEAR(plane.c, 10.0, 1e-12);
}

TEST(PlaneFit, scoresAPointAtTheThresholdAsAnInlier) {
  PlaneRefinementParameters parameters;
  parameters.inlier_threshold = 1.0;
  parameters.max_iterations = 1000;
  // Half of the points at 5 px, a quarter 1 px above, a quarter 1 px below. If these count, w is 1 and the
  // least number of trials is enough.
  cv::Mat map = planeMap(16, 16, 0.0, 0.0, 5.0);
  for (int y = 0; y < 16; ++y) {
    for (int x = y % 2; x < 16; x += 2) map.at<float>(y, x) += x % 4 < 2 ? 1.0F : -1.0F;
  }
  EXPECT_EQ(fit(map, parameters).iterations, 30);
}

TEST(PlaneFit, acceptsSlopesUpToTheLimitOnly) {
  PlaneRefinementParameters parameters;
  parameters.max_slope_x = 0.875;
  parameters.max_slope_y = 1.5;
  EXPECT_EQ(fit(planeMap(20, 20, 0.875, 0.0, 20.0), parameters).status, PlaneStatus::ACCEPTED);
  EXPECT_EQ(fit(planeMap(20, 20, -0.875, 0.0, 20.0), parameters).status, PlaneStatus::ACCEPTED);
  EXPECT_EQ(fit(planeMap(20, 20, 0.0, 1.5, 20.0), parameters).status, PlaneStatus::ACCEPTED);
  EXPECT_EQ(fit(planeMap(20, 20, 0.0, -1.5, 40.0), parameters).status, PlaneStatus::ACCEPTED);

  const double step = 1.0 / 1024.0;  // The map holds these slopes exactly.
  EXPECT_EQ(fit(planeMap(20, 20, 0.875 + step, 0.0, 20.0), parameters).status, PlaneStatus::DEGENERATE);
  EXPECT_EQ(fit(planeMap(20, 20, -0.875 - step, 0.0, 40.0), parameters).status, PlaneStatus::DEGENERATE);
  EXPECT_EQ(fit(planeMap(20, 20, 0.0, 1.5 + step, 20.0), parameters).status, PlaneStatus::DEGENERATE);
  const SegmentPlane plane = fit(planeMap(20, 20, 0.0, -1.5 - step, 60.0), parameters);
  EXPECT_EQ(plane.status, PlaneStatus::DEGENERATE);
  EXPECT_EQ(plane.inliers, 0);
  EXPECT_EQ(plane.a, 0.0);
  EXPECT_EQ(plane.b, 0.0);
  EXPECT_EQ(plane.c, 0.0);
}

TEST(PlaneFit, keepsTheSlopesOfTheLeastSquaresPlaneWithinTheLimit) {
  PlaneRefinementParameters parameters;
  parameters.max_slope_x = 0.5;
  // All points are inliers of the steepest plane that is allowed, but the least-squares plane is steeper.
  cv::Mat map = planeMap(20, 20, 0.5, 0.0, 20.0);
  map.col(0) -= cv::Scalar(0.75);
  map.col(19) += cv::Scalar(0.75);
  for (int seed = 0; seed < 20; ++seed) {
    const SegmentPlane plane = fit(map, parameters, seed);
    EXPECT_EQ(plane.status, PlaneStatus::ACCEPTED);
    EXPECT_LE(plane.a, 0.5);
  }
}

TEST(PlaneFit, isDegenerateForPointsOnALine) {
  EXPECT_EQ(fit(planeMap(1, 50, 0.25, 0.0, 20.0)).status, PlaneStatus::DEGENERATE);
  EXPECT_EQ(fit(planeMap(50, 1, 0.0, 0.25, 20.0)).status, PlaneStatus::DEGENERATE);

  PlaneRefinementParameters parameters;
  parameters.min_valid_fraction = 0.0;
  cv::Mat diagonal(50, 50, CV_32FC1, cv::Scalar(RANGE.invalid()));
  for (int i = 0; i < 50; ++i) diagonal.at<float>(i, i) = 20.0F;
  const SegmentPlane plane = fit(diagonal, parameters);
  EXPECT_EQ(plane.status, PlaneStatus::DEGENERATE);
  EXPECT_EQ(plane.valid, 50);
  EXPECT_EQ(plane.iterations, parameters.max_iterations);

  diagonal.at<float>(0, 49) = 20.0F;
  EXPECT_EQ(fit(diagonal, parameters).status, PlaneStatus::ACCEPTED);
}

TEST(PlaneFit, needsTheLeastShareOfValidPoints) {
  PlaneRefinementParameters parameters;
  parameters.min_valid_fraction = 0.3;
  cv::Mat map(10, 10, CV_32FC1, cv::Scalar(RANGE.invalid()));
  map.rowRange(0, 3).setTo(20.0);
  EXPECT_EQ(fit(map, parameters).status, PlaneStatus::ACCEPTED);

  map.at<float>(1, 5) = RANGE.invalid();
  const SegmentPlane plane = fit(map, parameters);
  EXPECT_EQ(plane.status, PlaneStatus::TOO_FEW_POINTS);
  EXPECT_EQ(plane.pixels, 100);
  EXPECT_EQ(plane.valid, 29);
  EXPECT_EQ(plane.iterations, 0);
}

TEST(PlaneFit, needsTheLeastNumberOfValidPoints) {
  PlaneRefinementParameters parameters;
  parameters.min_valid_points = 12;
  EXPECT_EQ(fit(planeMap(3, 4, 0.0, 0.0, 20.0), parameters).status, PlaneStatus::ACCEPTED);
  cv::Mat map = planeMap(3, 4, 0.0, 0.0, 20.0);
  map.at<float>(2, 3) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(fit(map, parameters).status, PlaneStatus::TOO_FEW_POINTS);

  parameters.min_valid_points = 3;
  EXPECT_EQ(fit(planeMap(2, 2, 0.0, 0.0, 20.0), parameters).status, PlaneStatus::ACCEPTED);
}

// Half of the points are on a plane, and no other plane has more than a few: w = 1/2, and (1 - w^3)^n =
// (7/8)^n is 0.0107 for n = 34 and 0.0093 for n = 35.
cv::Mat halfPlane(int side, double d, cv::RNG& random) {
  cv::Mat map = planeMap(side, side, 0.0, 0.0, d);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      if ((x + y) % 2 == 0) map.at<float>(y, x) = random.uniform(8.0F, 128.0F);
    }
  }
  return map;
}

TEST(PlaneFit, needsTheStoppingRuleWithinTheNumberOfIterations) {
  cv::RNG random(11);
  PlaneRefinementParameters parameters;
  parameters.confidence = 0.99;
  int refused = 0, accepted = 0;
  for (int seed = 0; seed < 100; ++seed) {
    const cv::Mat map = halfPlane(16, 5.0, random);
    parameters.max_iterations = 34;
    SegmentPlane plane = fit(map, parameters, seed);
    EXPECT_NE(plane.status, PlaneStatus::ACCEPTED);
    EXPECT_EQ(plane.iterations, 34);
    EXPECT_EQ(plane.inliers, 0);
    EXPECT_EQ(plane.c, 0.0);
    refused += plane.status == PlaneStatus::MAX_ITERATIONS ? 1 : 0;

    parameters.max_iterations = 35;
    plane = fit(map, parameters, seed);
    EXPECT_EQ(plane.iterations, 35);
    if (plane.status != PlaneStatus::ACCEPTED) continue;
    ++accepted;
    EXPECT_EQ(plane.inliers, 128);
    EXPECT_NEAR(plane.c, 5.0, 1e-9);
  }
  // One run of a hundred may meet no sample of inliers only.
  EXPECT_GE(refused, 95);
  EXPECT_GE(accepted, 95);
}

TEST(PlaneFit, needsOneIterationOnly) {
  PlaneRefinementParameters parameters;
  parameters.max_iterations = 1;
  // Any two rows: most samples are no line. All points are inliers, and one trial is enough by the rule.
  int accepted = 0;
  for (int seed = 0; seed < 20; ++seed) {
    const SegmentPlane plane = fit(planeMap(20, 20, 0.25, 0.125, 20.0), parameters, seed);
    EXPECT_EQ(plane.iterations, 1);
    accepted += plane.status == PlaneStatus::ACCEPTED ? 1 : 0;
  }
  EXPECT_GE(accepted, 18);
}

TEST(PlaneFit, goesOnForFourTimesTheTrialsOfTheRuleButThirtyAtLeast) {
  PlaneRefinementParameters parameters;
  parameters.max_iterations = 1000;
  EXPECT_EQ(fit(planeMap(16, 16, 0.0, 0.0, 5.0), parameters).iterations, 30);
  cv::RNG random(5);
  EXPECT_EQ(fit(halfPlane(16, 5.0, random), parameters).iterations, 4 * 35);
  // The share of inliers is that of the real points also where their number is no multiple of anything.
  EXPECT_EQ(fit(halfPlane(10, 0.0, random), parameters).iterations, 4 * 35);
}

TEST(PlaneFit, dependsOnTheSeedAlone) {
  cv::RNG random(13);
  cv::Mat map = planeMap(60, 60, 0.1, 0.2, 20.0);
  addNoise(map, 0.5, random);
  addOutliers(map, 0.5, random);
  const SegmentPlane first = fit(map, {}, 42), same = fit(map, {}, 42), other = fit(map, {}, 43);
  EXPECT_EQ(first.a, same.a);
  EXPECT_EQ(first.b, same.b);
  EXPECT_EQ(first.c, same.c);
  EXPECT_EQ(first.inliers, same.inliers);
  EXPECT_NE(first.c, other.c);
}

}  // namespace
}  // namespace disparity_refinement
