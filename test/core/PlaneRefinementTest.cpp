#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <functional>
#include <limits>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "disparity_refinement/refinement/PlaneRefinement.hpp"

namespace {

// Strings of the checked arguments do not count.
constexpr std::size_t LARGE_ALLOCATION = 256;
std::atomic<int> large_allocations{0};

}  // namespace

// Not inline: the compiler would take the halves of a pair for mismatched.
__attribute__((noinline)) void* operator new(std::size_t size) {
  if (size >= LARGE_ALLOCATION) ++large_allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}

__attribute__((noinline)) void operator delete(void* memory) noexcept { std::free(memory); }
__attribute__((noinline)) void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace disparity_refinement {
namespace {

const float NOT_A_NUMBER = std::numeric_limits<float>::quiet_NaN();
const float INFINITE = std::numeric_limits<float>::infinity();
const DisparityRange RANGE{0.0F, 128.0F};
const float HOLE = -1.0F;

// Without the bound on the depth; a narrow inlier threshold, so that a pixel off the plane does not move it.
PlaneRefinementParameters baseParameters() {
  PlaneRefinementParameters parameters;
  parameters.disparity_error = 0.0;
  parameters.inlier_threshold = 0.125;
  return parameters;
}

cv::Mat planeMap(int rows, int cols, double a, double b, double c) {
  cv::Mat map(rows, cols, CV_32FC1);
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < cols; ++x) map.at<float>(y, x) = static_cast<float>(a * x + b * y + c);
  }
  return map;
}

cv::Mat oneSegment(const cv::Mat& disparity) { return cv::Mat::zeros(disparity.size(), CV_32SC1); }

// The refined map where all pixels are one segment.
cv::Mat refineOneSegment(const cv::Mat& disparity, const PlaneRefinementParameters& parameters,
                         const DisparityRange& range = RANGE, double focal_length_times_baseline = 128.0) {
  cv::Mat refined;
  PlaneRefinement().refine(disparity, oneSegment(disparity), range, focal_length_times_baseline, parameters,
                           refined);
  return refined;
}

// Noisy segments of random shape with holes and outliers; some labels are negative, some pixels not finite.
void randomFrame(const cv::Size& size, int segments, int seed, cv::Mat& disparity, cv::Mat& labels) {
  cv::RNG random(seed);
  labels.create(size, CV_32SC1);
  disparity.create(size, CV_32FC1);
  std::vector<cv::Point> centres;
  std::vector<cv::Vec3d> planes;
  for (int i = 0; i < segments; ++i) {
    centres.emplace_back(random.uniform(0, size.width), random.uniform(0, size.height));
    planes.emplace_back(random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3), random.uniform(5.0, 120.0));
  }
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      int nearest = 0;
      for (int i = 1; i < segments; ++i) {
        const cv::Point p(x, y);
        if (cv::norm(p - centres[i]) < cv::norm(p - centres[nearest])) nearest = i;
      }
      const cv::Point offset = cv::Point(x, y) - centres[nearest];
      const cv::Vec3d& plane = planes[nearest];
      float& d = disparity.at<float>(y, x);
      d = static_cast<float>(plane[0] * offset.x + plane[1] * offset.y + plane[2] + random.gaussian(0.2));
      const double kind = random.uniform(0.0, 1.0);
      if (kind < 0.3) d = RANGE.invalid();
      if (kind < 0.1) d = random.uniform(-5.0F, 140.0F);
      if (kind < 0.01) d = NOT_A_NUMBER;
      if (kind < 0.005) d = INFINITE;
      labels.at<int>(y, x) = nearest % 7 == 3 ? -1 : nearest;
    }
  }
}

// Bit for bit, so that NaN would count.
void expectSameBits(const cv::Mat& actual, const cv::Mat& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  ASSERT_EQ(actual.type(), expected.type());
  for (int y = 0; y < actual.rows; ++y) {
    EXPECT_TRUE(std::equal(actual.ptr(y), actual.ptr(y) + actual.cols * actual.elemSize(), expected.ptr(y)))
        << "row " << y;
  }
}

void expectMessage(const std::function<void()>& call, const std::string& message) {
  try {
    call();
    ADD_FAILURE() << "accepted, expected: " << message;
  } catch (const std::invalid_argument& error) {
    EXPECT_EQ(std::string(error.what()).substr(0, message.size()), message);
  }
}

TEST(PlaneRefinement, fillsHolesAndReplacesNoise) {
  cv::Mat map = planeMap(10, 12, 0.25, 0.5, 20.0);
  const cv::Mat plane = map.clone();
  map.at<float>(4, 5) = HOLE;
  map.at<float>(6, 7) += 1.0F;
  cv::Mat expected = plane.clone();
  expected.at<float>(0, 0) = HOLE;  // A full map gives up one pixel.
  expectSameBits(refineOneSegment(map, baseParameters()), expected);
}

TEST(PlaneRefinement, writesThePlanesItReports) {
  // The four conditions, word by word, on random frames.
  for (int seed = 1; seed <= 5; ++seed) {
    cv::Mat disparity, labels, refined;
    randomFrame({97, 61}, 20, seed, disparity, labels);
    PlaneRefinementParameters parameters;
    parameters.disparity_error = 0.25;
    parameters.max_depth_error = 2.0;
    parameters.max_divergence = 1.5;
    const double focal_length_times_baseline = 3000.0;
    const double least = std::sqrt(3000.0 * 0.25 / 2.0);  // 19.4 px
    PlaneRefinement refinement;
    refinement.refine(disparity, labels, RANGE, focal_length_times_baseline, parameters, refined);
    ASSERT_EQ(refinement.planes().size(), 20U);

    int replaced = 0, kept = 0;
    for (int y = 0; y < labels.rows; ++y) {
      for (int x = 0; x < labels.cols; ++x) {
        const float d = disparity.at<float>(y, x);
        const bool valid = std::isfinite(d) && d >= 0.0F;
        float expected = valid ? d : -1.0F;
        const int label = labels.at<int>(y, x);
        if (label >= 0 && refinement.planes()[label].status == PlaneStatus::ACCEPTED) {
          const SegmentPlane& plane = refinement.planes()[label];
          const float value = static_cast<float>(plane.a * x + (plane.b * y + plane.c));
          if (value >= least && value <= 128.0F && (!valid || std::abs(value - d) <= 1.5)) expected = value;
        }
        ASSERT_EQ(refined.at<float>(y, x), expected) << "seed " << seed << ", x " << x << ", y " << y;
        (expected == d ? kept : replaced) += 1;
      }
    }
    EXPECT_GT(replaced, 1000);
    EXPECT_GT(kept, 500);
  }
}

TEST(PlaneRefinement, reportsAPlaneForEveryLabel) {
  cv::Mat disparity = planeMap(20, 30, 0.0, 0.0, 10.0);
  cv::Mat labels(disparity.size(), CV_32SC1, cv::Scalar(-1));
  labels.colRange(0, 10).setTo(0);   // A plane.
  labels.colRange(12, 13).setTo(1);  // A line.
  labels.colRange(14, 16).setTo(4);  // No disparity. Labels 2 and 3 are missing.
  disparity.colRange(14, 16).setTo(HOLE);
  disparity.at<float>(3, 3) = 90.0F;
  disparity.at<float>(4, 4) = HOLE;
  PlaneRefinement refinement;
  cv::Mat refined;
  refinement.refine(disparity, labels, RANGE, 1.0, baseParameters(), refined);

  const auto& planes = refinement.planes();
  ASSERT_EQ(planes.size(), 5U);
  EXPECT_EQ(planes[0].status, PlaneStatus::ACCEPTED);
  EXPECT_EQ(planes[0].pixels, 200);
  EXPECT_EQ(planes[0].valid, 199);
  EXPECT_EQ(planes[0].inliers, 198);
  EXPECT_EQ(planes[0].inlierShare(), 198.0 / 199.0);
  EXPECT_EQ(planes[0].iterations, 30);
  EXPECT_EQ(planes[0].c, 10.0);
  EXPECT_EQ(planes[1].status, PlaneStatus::DEGENERATE);
  EXPECT_EQ(planes[1].pixels, 20);
  EXPECT_EQ(planes[2].status, PlaneStatus::TOO_FEW_POINTS);
  EXPECT_EQ(planes[2].pixels, 0);
  EXPECT_EQ(planes[4].status, PlaneStatus::TOO_FEW_POINTS);
  EXPECT_EQ(planes[4].pixels, 40);
  EXPECT_EQ(planes[4].valid, 0);
  EXPECT_EQ(planes[4].inlierShare(), 0.0);
}

TEST(PlaneRefinement, namesEveryStatus) {
  EXPECT_STREQ(toString(PlaneStatus::ACCEPTED), "accepted");
  EXPECT_STREQ(toString(PlaneStatus::TOO_FEW_POINTS), "too few points");
  EXPECT_STREQ(toString(PlaneStatus::DEGENERATE), "degenerate");
  EXPECT_STREQ(toString(PlaneStatus::MAX_ITERATIONS), "maximum number of iterations");
  EXPECT_STREQ(toString(PlaneStatus::OF_NEIGHBOUR), "of a neighbour");
}

// Condition 1

// sqrt(f * T * disparity_error / max_depth_error) = sqrt(128 / 16 / 2) = 2 px.
PlaneRefinementParameters depthParameters() {
  PlaneRefinementParameters parameters = baseParameters();
  parameters.disparity_error = 1.0 / 16.0;
  parameters.max_depth_error = 2.0;
  return parameters;
}

TEST(PlaneRefinement, fillsAHoleOnlyWhereThePlaneIsNearEnough) {
  cv::Mat map = planeMap(16, 8, 0.0, 0.25, 0.5);  // 2 px in row 6.
  map.col(3).setTo(HOLE);
  const cv::Mat refined = refineOneSegment(map, depthParameters(), RANGE, 128.0);
  for (int y = 0; y < 16; ++y) {
    EXPECT_EQ(refined.at<float>(y, 3), y < 6 ? HOLE : 0.25F * y + 0.5F) << "row " << y;
  }
}

TEST(PlaneRefinement, replacesADisparityOnlyWhereThePlaneIsNearEnough) {
  cv::Mat map = planeMap(16, 8, 0.0, 0.25, 0.5);
  map.at<float>(5, 3) = 2.5F;   // Near enough itself, but its plane, 1.75 px, is not.
  map.at<float>(6, 3) = 1.25F;  // Too far itself, but its plane is at 2 px.
  const cv::Mat refined = refineOneSegment(map, depthParameters(), RANGE, 128.0);
  EXPECT_EQ(refined.at<float>(5, 3), 2.5F);
  EXPECT_EQ(refined.at<float>(6, 3), 2.0F);
}

TEST(PlaneRefinement, hasNoBoundOnTheDepthWithoutADisparityError) {
  PlaneRefinementParameters parameters = depthParameters();
  parameters.disparity_error = 0.0;
  const DisparityRange range{-8.0F, 120.0F};
  cv::Mat map = planeMap(16, 8, 0.0, 0.25, -4.0);
  map.col(3).setTo(range.invalid());
  const cv::Mat refined = refineOneSegment(map, parameters, range, 128.0);
  for (int y = 1; y < 16; ++y) EXPECT_EQ(refined.at<float>(y, 3), 0.25F * y - 4.0F);
}

// Condition 2

TEST(PlaneRefinement, leavesASegmentWithTooFewPoints) {
  PlaneRefinementParameters parameters = baseParameters();
  parameters.min_valid_fraction = 0.3;
  parameters.min_valid_points = 12;
  cv::Mat map(10, 10, CV_32FC1, cv::Scalar(HOLE));
  map.rowRange(4, 7).setTo(20.0F);
  EXPECT_EQ(cv::countNonZero(refineOneSegment(map, parameters) == 20.0F), 99);  // One stays invalid.
  map.at<float>(5, 5) = HOLE;
  expectSameBits(refineOneSegment(map, parameters), map);
}

// Condition 3

TEST(PlaneRefinement, leavesASegmentThatRansacDoesNotFinish) {
  // 3/4 of the points are on the plane: (1 - 27/64)^n is 0.0124 for n = 8 and 0.0072 for n = 9.
  cv::RNG random(17);
  PlaneRefinementParameters parameters = baseParameters();
  int replaced = 0;
  for (int i = 0; i < 50; ++i) {
    cv::Mat map = planeMap(16, 16, 0.0, 0.0, 5.0);
    for (int y = 0; y < 16; y += 2) {
      for (int x = 0; x < 16; x += 2) map.at<float>(y, x) = random.uniform(30.0F, 60.0F);
    }
    map.at<float>(8, 8) = 6.0F;
    parameters.max_iterations = 8;
    EXPECT_EQ(refineOneSegment(map, parameters).at<float>(8, 8), 6.0F);
    parameters.max_iterations = 9;
    replaced += refineOneSegment(map, parameters).at<float>(8, 8) == 5.0F ? 1 : 0;
  }
  EXPECT_GE(replaced, 47);
}

// Condition 4

// What becomes of a disparity at this distance from its plane, 20 px, if max_divergence is 3 px.
float atDistance(float distance, DivergenceAction action) {
  PlaneRefinementParameters parameters = baseParameters();
  parameters.max_divergence = 3.0;
  parameters.divergence_action = action;
  cv::Mat map = planeMap(10, 10, 0.0, 0.0, 20.0);
  map.at<float>(5, 5) += distance;
  return refineOneSegment(map, parameters).at<float>(5, 5);
}

TEST(PlaneRefinement, replacesADisparityUpToTheLargestDivergence) {
  for (const auto action :
       {DivergenceAction::KEEP, DivergenceAction::INVALIDATE, DivergenceAction::TAKE_PLANE}) {
    EXPECT_EQ(atDistance(3.0F, action), 20.0F);
    EXPECT_EQ(atDistance(-3.0F, action), 20.0F);
  }
  const float beyond = 3.0F + 1.0F / 1024.0F;
  EXPECT_EQ(atDistance(beyond, DivergenceAction::KEEP), 20.0F + beyond);
  EXPECT_EQ(atDistance(-beyond, DivergenceAction::KEEP), 20.0F - beyond);
  EXPECT_EQ(atDistance(beyond, DivergenceAction::INVALIDATE), HOLE);
  EXPECT_EQ(atDistance(-beyond, DivergenceAction::INVALIDATE), HOLE);
  EXPECT_EQ(atDistance(beyond, DivergenceAction::TAKE_PLANE), 20.0F);
  EXPECT_EQ(atDistance(-beyond, DivergenceAction::TAKE_PLANE), 20.0F);
}

TEST(PlaneRefinement, decidesEveryPixelOfARunOnce) {
  // A pixel that has become invalid is not filled afterwards, wherever it is in a run of any length.
  PlaneRefinementParameters parameters = baseParameters();
  parameters.divergence_action = DivergenceAction::INVALIDATE;
  for (int cols = 1; cols <= 14; ++cols) {
    for (int x = 0; x < cols; ++x) {
      cv::Mat map = planeMap(20, 16, 0.0, 0.0, 20.0);
      cv::Mat labels(map.size(), CV_32SC1, cv::Scalar(-1));
      labels.rowRange(0, 10).setTo(0);
      labels.row(12).colRange(1, 1 + cols).setTo(0);
      map.at<float>(12, 1 + x) = 30.0F;
      map.at<float>(12, 0) = map.at<float>(12, 1 + cols) = 20.5F;  // Not of the segment.
      cv::Mat expected = map.clone();
      expected.at<float>(12, 1 + x) = HOLE;
      cv::Mat refined;
      PlaneRefinement().refine(map, labels, RANGE, 1.0, parameters, refined);
      expectSameBits(refined, expected);
    }
  }
}

TEST(PlaneRefinement, takesNoActionOnDivergenceWhereAnotherConditionFails) {
  for (const auto action : {DivergenceAction::INVALIDATE, DivergenceAction::TAKE_PLANE}) {
    PlaneRefinementParameters parameters = depthParameters();
    parameters.divergence_action = action;
    cv::Mat map = planeMap(16, 8, 0.0, 0.25, 0.5);
    map.at<float>(5, 3) = 30.0F;
    EXPECT_EQ(refineOneSegment(map, parameters, RANGE, 128.0).at<float>(5, 3), 30.0F);
  }
}

// Range

TEST(PlaneRefinement, doesNotWriteAPlaneOutsideTheRange) {
  const DisparityRange range{4.0F, 12.0F};
  cv::Mat map = planeMap(20, 8, 0.0, 1.0, 0.0);
  map.rowRange(0, 4).setTo(range.invalid());
  map.col(3).setTo(range.invalid());
  map.at<float>(13, 5) = 11.0F;  // Its plane, 13 px, is out of range.
  map.at<float>(11, 5) = 13.0F;  // Out of range itself, but its plane is not.
  for (const auto& parameters : {baseParameters(), depthParameters()}) {
    const cv::Mat refined = refineOneSegment(map, parameters, range, 128.0);
    for (int y = 0; y < 20; ++y) {
      EXPECT_EQ(refined.at<float>(y, 3), y < 4 || y > 12 ? range.invalid() : static_cast<float>(y));
    }
    EXPECT_EQ(refined.at<float>(13, 5), 11.0F);
    EXPECT_EQ(refined.at<float>(11, 5), 11.0F);
    EXPECT_EQ(refined.at<float>(19, 0), 19.0F);  // A measured disparity above the range stays.
  }
}

TEST(PlaneRefinement, clampsAPlaneToTheRange) {
  const DisparityRange range{4.0F, 12.0F};
  PlaneRefinementParameters parameters = baseParameters();
  parameters.out_of_range_action = OutOfRangeAction::CLAMP;
  cv::Mat map = planeMap(20, 8, 0.0, 1.0, 0.0);
  map.rowRange(0, 4).setTo(range.invalid());
  map.col(3).setTo(range.invalid());
  map.at<float>(13, 5) = 11.0F;
  const cv::Mat refined = refineOneSegment(map, parameters, range);
  for (int y = 0; y < 20; ++y) {
    EXPECT_EQ(refined.at<float>(y, 3), std::min(std::max(static_cast<float>(y), 4.0F), 12.0F));
  }
  EXPECT_EQ(refined.at<float>(13, 5), 12.0F);
  EXPECT_EQ(refined.at<float>(15, 0),
            12.0F);  // 3 px above the end of the range: as far as max_divergence goes.
  EXPECT_EQ(refined.at<float>(16, 0), 16.0F);
}

TEST(PlaneRefinement, looksAtTheDepthOfTheClampedPlane) {
  PlaneRefinementParameters parameters = depthParameters();  // At least 2 px.
  parameters.out_of_range_action = OutOfRangeAction::CLAMP;
  cv::Mat map = planeMap(16, 8, 0.0, 0.5, 0.0);
  map.col(3).setTo(HOLE);
  EXPECT_EQ(refineOneSegment(map, parameters, {1.0F, 6.0F}, 128.0).at<float>(0, 3), 0.0F);
  EXPECT_EQ(refineOneSegment(map, parameters, {2.0F, 6.0F}, 128.0).at<float>(0, 3), 2.0F);
}

// Pixels that no plane concerns

TEST(PlaneRefinement, turnsEverythingWithoutADisparityIntoTheInvalidValue) {
  const DisparityRange range{2.0F, 128.0F};
  const cv::Mat map = (cv::Mat_<float>(2, 4) << NOT_A_NUMBER, INFINITE, -INFINITE, 1.0F,  //
                       1.9375F, 0.0F, 2.0F, 500.0F);
  const cv::Mat expected = (cv::Mat_<float>(2, 4) << 1, 1, 1, 1, 1, 1, 2, 500);
  const cv::Mat no_segment(map.size(), CV_32SC1, cv::Scalar(-1));
  PlaneRefinement refinement;
  cv::Mat refined;
  refinement.refine(map, oneSegment(map), range, 1.0, {}, refined);  // Two points are too few.
  expectSameBits(refined, expected);
  EXPECT_EQ(refinement.planes()[0].valid, 2);
  refinement.refine(map, no_segment, range, 1.0, {}, refined);
  expectSameBits(refined, expected);
  EXPECT_TRUE(refinement.planes().empty());
}

TEST(PlaneRefinement, ignoresWhatIsNoDisparityInTheFit) {
  cv::Mat map = planeMap(20, 20, 0.25, 0.125, 10.0);
  const cv::Mat plane = map.clone();
  const float nothing[] = {NOT_A_NUMBER, INFINITE, -INFINITE, HOLE, -20.0F};
  for (int i = 0; i < 200; ++i) map.at<float>(i / 10, i % 10) = nothing[i % 5];
  const cv::Mat refined = refineOneSegment(map, baseParameters());
  EXPECT_EQ(cv::norm(refined.rowRange(1, 20), plane.rowRange(1, 20), cv::NORM_INF), 0.0);
}

TEST(PlaneRefinement, keepsThePixelsOfNegativeLabels) {
  cv::Mat map = planeMap(10, 10, 0.0, 0.0, 20.0);
  cv::Mat labels = oneSegment(map);
  labels.row(4).setTo(-1);
  labels.row(5).setTo(std::numeric_limits<int>::min());
  map.at<float>(4, 3) = HOLE;
  map.at<float>(5, 3) = 21.0F;
  map.at<float>(6, 3) = HOLE;
  cv::Mat refined;
  PlaneRefinement().refine(map, labels, RANGE, 1.0, baseParameters(), refined);
  EXPECT_EQ(refined.at<float>(4, 3), HOLE);
  EXPECT_EQ(refined.at<float>(5, 3), 21.0F);
  EXPECT_EQ(refined.at<float>(6, 3), 20.0F);
}

TEST(PlaneRefinement, leavesAtLeastOneInvalidPixel) {
  const cv::Mat map = planeMap(10, 10, 0.0, 0.0, 20.0);
  const cv::Mat refined = refineOneSegment(map, baseParameters());
  EXPECT_EQ(refined.at<float>(0, 0), HOLE);
  EXPECT_EQ(cv::countNonZero(refined == 20.0F), 99);
}

// Images

TEST(PlaneRefinement, takesImagesOfEverySize) {
  for (const cv::Size size :
       {cv::Size(1, 1), cv::Size(17, 1), cv::Size(1, 17), cv::Size(3, 3), cv::Size(65, 33)}) {
    cv::Mat map(size, CV_32FC1, cv::Scalar(20.0));
    map.at<float>(0, 0) = HOLE;
    const bool is_line = size.width == 1 || size.height == 1;
    PlaneRefinementParameters parameters = baseParameters();
    parameters.min_valid_points = 3;
    cv::Mat expected = map.clone();
    if (size.area() > 1) map.at<float>(size.height - 1, size.width - 1) = HOLE;
    if (is_line) expected = map.clone();  // Spans no plane.
    expectSameBits(refineOneSegment(map, parameters), expected);
  }
}

TEST(PlaneRefinement, takesPartsOfLargerImages) {
  cv::Mat disparity, labels, expected;
  randomFrame({51, 37}, 8, 3, disparity, labels);
  PlaneRefinement().refine(disparity, labels, RANGE, 388.0, {}, expected);

  cv::Mat large_disparity(60, 90, CV_32FC1, cv::Scalar(77)),
      large_labels(60, 90, CV_32SC1, cv::Scalar(1 << 30));
  cv::Mat large_refined(60, 90, CV_32FC1, cv::Scalar(55));
  cv::Mat part_disparity = large_disparity(cv::Rect(3, 5, 51, 37));
  cv::Mat part_labels = large_labels(cv::Rect(20, 2, 51, 37));
  cv::Mat part_refined = large_refined(cv::Rect(39, 23, 51, 37));
  disparity.copyTo(part_disparity);
  labels.copyTo(part_labels);
  PlaneRefinement().refine(part_disparity, part_labels, RANGE, 388.0, {}, part_refined);
  expectSameBits(part_refined, expected);
  EXPECT_EQ(part_refined.data, large_refined.ptr(23) + 39 * sizeof(float));
  EXPECT_EQ(cv::countNonZero(large_refined != 55.0F), cv::countNonZero(part_refined != 55.0F));
}

TEST(PlaneRefinement, writesIntoAnOutputOfTheRightTypeAndSize) {
  cv::Mat disparity, labels;
  randomFrame({31, 21}, 4, 5, disparity, labels);
  const cv::Mat disparity_before = disparity.clone(), labels_before = labels.clone();
  cv::Mat refined(disparity.size(), CV_32FC1);
  const uchar* const data = refined.data;
  PlaneRefinement refinement;
  refinement.refine(disparity, labels, RANGE, 388.0, {}, refined);
  EXPECT_EQ(refined.data, data);
  expectSameBits(disparity, disparity_before);
  expectSameBits(labels, labels_before);

  cv::Mat other(2, 2, CV_8UC1);
  refinement.refine(disparity, labels, RANGE, 388.0, {}, other);
  expectSameBits(other, refined);
}

TEST(PlaneRefinement, isTheSameForAnyNumberOfThreads) {
  cv::Mat disparity, labels, expected;
  randomFrame({160, 120}, 60, 7, disparity, labels);
  const int threads_before = cv::getNumThreads();
  cv::setNumThreads(1);
  PlaneRefinement().refine(disparity, labels, RANGE, 388.0, {}, expected);
  for (const int threads : {2, 4}) {
    cv::setNumThreads(threads);
    cv::Mat refined;
    PlaneRefinement().refine(disparity, labels, RANGE, 388.0, {}, refined);
    expectSameBits(refined, expected);
  }
  cv::setNumThreads(threads_before);
}

TEST(PlaneRefinement, keepsItsBuffers) {
  cv::Mat disparity, labels, refined;
  randomFrame({320, 200}, 60, 7, disparity, labels);
  const int threads_before = cv::getNumThreads();
  cv::setNumThreads(1);
  PlaneRefinement refinement;
  large_allocations = 0;
  refinement.refine(disparity, labels, RANGE, 388.0, {}, refined);
  EXPECT_GT(large_allocations, 0);
  // Slightly more runs and a slightly larger segment than ever before fit too.
  labels.rowRange(0, 2).setTo(labels.at<int>(10, 10));
  large_allocations = 0;
  refinement.refine(disparity, labels, RANGE, 388.0, {}, refined);
  EXPECT_EQ(large_allocations, 0);
  cv::setNumThreads(threads_before);
}

TEST(PlaneRefinement, isTheSameInAUsedObject) {
  PlaneRefinement used;
  cv::Mat from_used;
  int seed = 1;
  for (const cv::Size size : {cv::Size(80, 60), cv::Size(33, 21), cv::Size(1, 1), cv::Size(97, 71)}) {
    for (const int segments : {30, 1, 5}) {
      cv::Mat disparity, labels, from_fresh;
      randomFrame(size, segments, ++seed, disparity, labels);
      if (size.area() == 1) labels.setTo(0);
      PlaneRefinement fresh;
      used.refine(disparity, labels, RANGE, 388.0, {}, from_used);
      fresh.refine(disparity, labels, RANGE, 388.0, {}, from_fresh);
      expectSameBits(from_used, from_fresh);
      EXPECT_EQ(used.planes().size(), fresh.planes().size());
    }
  }
}

TEST(PlaneRefinement, fitsASegmentWithoutRegardToTheOthers) {
  cv::Mat disparity, labels, refined;
  randomFrame({80, 60}, 10, 9, disparity, labels);
  PlaneRefinementParameters parameters;
  parameters.inlier_threshold = 0.2;  // As wide as the noise: the plane depends on the samples drawn.
  PlaneRefinement refinement;
  refinement.refine(disparity, labels, RANGE, 388.0, parameters, refined);
  const SegmentPlane before = refinement.planes()[2];
  ASSERT_EQ(before.status, PlaneStatus::ACCEPTED);
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (labels.at<int>(y, x) == 2) continue;
      labels.at<int>(y, x) = (x + y) % 40;
      if (labels.at<int>(y, x) == 2) labels.at<int>(y, x) = -1;
      disparity.at<float>(y, x) = static_cast<float>(x);
    }
  }
  refinement.refine(disparity, labels, RANGE, 388.0, parameters, refined);
  const SegmentPlane after = refinement.planes()[2];
  EXPECT_EQ(after.a, before.a);
  EXPECT_EQ(after.b, before.b);
  EXPECT_EQ(after.c, before.c);
  EXPECT_EQ(after.iterations, before.iterations);
}

TEST(PlaneRefinement, refinesOneHugeSegment) {
  cv::Mat map = planeMap(3000, 4096, 0.0078125, 0.015625, 8.0);
  const float last = map.at<float>(2999, 4095);
  map.at<float>(2999, 4095) = HOLE;
  map.at<float>(0, 0) = HOLE;
  PlaneRefinement refinement;
  cv::Mat refined;
  refinement.refine(map, oneSegment(map), RANGE, 388.0, {}, refined);
  EXPECT_EQ(refinement.planes()[0].inliers, 4096 * 3000 - 2);
  EXPECT_EQ(refined.at<float>(2999, 4095), last);
}

TEST(PlaneRefinement, refinesVeryManySegments) {
  cv::Mat map = planeMap(3000, 4096, 0.0078125, 0.015625, 8.0);
  cv::Mat labels(map.size(), CV_32SC1);
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      labels.at<int>(y, x) = y / 4 * 1024 + x / 4;
      if (x % 4 == 2 && y % 4 == 2) map.at<float>(y, x) = HOLE;
    }
  }
  PlaneRefinement refinement;
  cv::Mat refined;
  refinement.refine(map, labels, RANGE, 388.0, {}, refined);
  ASSERT_EQ(refinement.planes().size(), 768000U);
  EXPECT_EQ(refinement.planes().back().status, PlaneStatus::ACCEPTED);
  EXPECT_EQ(refinement.planes().back().valid, 15);
  // All filled, but for the one pixel that stays invalid.
  EXPECT_EQ(cv::countNonZero(refined == HOLE), 1);
  EXPECT_EQ(refined.at<float>(2998, 4094), 4094 * 0.0078125F + 2998 * 0.015625F + 8.0F);
}

// Bad input

TEST(PlaneRefinement, refusesBadImages) {
  const cv::Mat disparity(4, 6, CV_32FC1, cv::Scalar(20)), labels = oneSegment(disparity);
  const PlaneRefinementParameters parameters;
  cv::Mat refined;
  const auto refine = [&](const cv::Mat& d, const cv::Mat& l) {
    return [&parameters, &refined, d, l] { PlaneRefinement().refine(d, l, RANGE, 1.0, parameters, refined); };
  };
  expectMessage(refine(cv::Mat(), labels),
                "disparity is CV_8UC1 of 0x0, expected CV_32FC1 of 0x0, not empty");
  expectMessage(refine(cv::Mat(4, 6, CV_16SC1), labels), "disparity is CV_16SC1 of 6x4, expected CV_32FC1");
  expectMessage(refine(disparity, cv::Mat(4, 5, CV_32SC1)),
                "labels is CV_32SC1 of 5x4, expected CV_32SC1 of 6x4");
  expectMessage(refine(disparity, cv::Mat(4, 6, CV_32FC1)),
                "labels is CV_32FC1 of 6x4, expected CV_32SC1 of 6x4");
  expectMessage(refine(disparity, cv::Mat(4, 6, CV_32SC1, cv::Scalar(24))),
                "labels is 24 at x = 0, y = 0, expected less than the number of pixels, 24");
  const int sizes[] = {4, 6, 2};
  expectMessage(refine(cv::Mat(3, sizes, CV_32FC1), labels), "disparity is CV_32FC1 of");
  EXPECT_TRUE(refined.empty());
}

TEST(PlaneRefinement, refusesAnOutputThatSharesMemoryWithAnInput) {
  cv::Mat disparity(4, 6, CV_32FC1, cv::Scalar(20)), labels = oneSegment(disparity);
  const cv::Mat before = disparity.clone();
  expectMessage([&] { PlaneRefinement().refine(disparity, labels, RANGE, 1.0, {}, disparity); },
                "refined is the memory of disparity");
  expectMessage([&] { PlaneRefinement().refine(disparity, labels, RANGE, 1.0, {}, labels); },
                "refined is the memory of labels");
  cv::Mat large(9, 6, CV_32FC1, cv::Scalar(20));
  cv::Mat upper = large.rowRange(0, 4), lower = large.rowRange(3, 7), below = large.rowRange(4, 8);
  expectMessage([&] { PlaneRefinement().refine(upper, labels, RANGE, 1.0, {}, lower); },
                "refined is the memory of disparity");
  EXPECT_NO_THROW(PlaneRefinement().refine(upper, labels, RANGE, 1.0, {}, below));
  expectSameBits(disparity, before);
}

TEST(PlaneRefinement, refusesABadRangeOrBaseline) {
  const cv::Mat disparity(4, 6, CV_32FC1, cv::Scalar(20)), labels = oneSegment(disparity);
  const auto refine = [&](const DisparityRange& range, double focal_length_times_baseline) {
    return [&, range, focal_length_times_baseline] {
      cv::Mat refined;
      PlaneRefinement().refine(disparity, labels, range, focal_length_times_baseline, {}, refined);
    };
  };
  expectMessage(refine({0.0F, 64.0F}, 0.0), "focal_length_times_baseline is 0, expected greater than 0");
  expectMessage(refine({0.0F, 64.0F}, -388.0),
                "focal_length_times_baseline is -388, expected greater than 0");
  expectMessage(refine({0.0F, 64.0F}, std::nan("")), "focal_length_times_baseline is nan");
  expectMessage(refine({0.0F, -1.0F}, 388.0),
                "range.max is -1, expected a finite number, at least range.min, 0");
  expectMessage(refine({NOT_A_NUMBER, 64.0F}, 388.0), "range.min is nan");
  // min - 1 is min.
  expectMessage(refine({-1e9F, 64.0F}, 388.0),
                "range.min is -1e+09, expected a finite number, of less than 2^24");
  expectMessage(refine({0.0F, INFINITE}, 388.0), "range.max is inf");
}

TEST(PlaneRefinement, validatesEveryParameter) {
  using P = PlaneRefinementParameters;
  EXPECT_NO_THROW(validate(P()));
  const auto expectRefused = [](const std::string& message, const std::function<void(P&)>& change) {
    P parameters;
    change(parameters);
    expectMessage([&] { validate(parameters); }, message);
  };
  const auto expectAccepted = [](const std::function<void(P&)>& change) {
    P parameters;
    change(parameters);
    EXPECT_NO_THROW(validate(parameters));
  };
  const double nan = NOT_A_NUMBER;
  expectRefused("inlier_threshold is 0, expected greater than 0", [](P& p) { p.inlier_threshold = 0.0; });
  expectRefused("inlier_threshold is nan", [&](P& p) { p.inlier_threshold = nan; });
  expectRefused("confidence is 0,", [](P& p) { p.confidence = 0.0; });
  expectRefused("confidence is 1,", [](P& p) { p.confidence = 1.0; });
  expectRefused("max_slope_x is 0,", [](P& p) { p.max_slope_x = 0.0; });
  expectRefused("max_slope_y is -1,", [](P& p) { p.max_slope_y = -1.0; });
  expectRefused("disparity_error is -0.5, expected at least 0", [](P& p) { p.disparity_error = -0.5; });
  expectAccepted([](P& p) { p.disparity_error = 0.0; });
  expectRefused("max_depth_error is 0,", [](P& p) { p.max_depth_error = 0.0; });
  expectRefused("min_valid_fraction is -0.1,", [](P& p) { p.min_valid_fraction = -0.1; });
  expectRefused("min_valid_fraction is 1.1,", [](P& p) { p.min_valid_fraction = 1.1; });
  expectAccepted([](P& p) { p.min_valid_fraction = 0.0; });
  expectAccepted([](P& p) { p.min_valid_fraction = 1.0; });
  expectRefused("min_valid_points is 2, expected at least 3", [](P& p) { p.min_valid_points = 2; });
  expectAccepted([](P& p) { p.min_valid_points = 3; });
  expectRefused("max_iterations is 0, expected at least 1", [](P& p) { p.max_iterations = 0; });
  expectAccepted([](P& p) { p.max_iterations = 1; });
  expectRefused("max_divergence is -1, expected at least 0", [](P& p) { p.max_divergence = -1.0; });
  expectAccepted([](P& p) { p.max_divergence = 0.0; });
  expectRefused("divergence_action is 3,",
                [](P& p) { p.divergence_action = static_cast<DivergenceAction>(3); });
  expectRefused("out_of_range_action is -1,",
                [](P& p) { p.out_of_range_action = static_cast<OutOfRangeAction>(-1); });

  cv::Mat refined;
  const cv::Mat disparity(4, 6, CV_32FC1, cv::Scalar(20));
  P bad;
  bad.max_iterations = 0;
  EXPECT_THROW(PlaneRefinement().refine(disparity, oneSegment(disparity), RANGE, 1.0, bad, refined),
               std::invalid_argument);
}

}  // namespace
}  // namespace disparity_refinement
