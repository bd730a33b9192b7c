#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "disparity_refinement/evaluation/KittiMetric.hpp"

namespace disparity_refinement {
namespace {

constexpr float N = -1.0F;  // no disparity
constexpr DisparityRange RANGE{0.0F, 128.0F};

bool equal(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF) == 0.0; }

TEST(InterpolateBackground, interiorRunsTakeTheSmallerEnd) {
  cv::Mat map = (cv::Mat_<float>(2, 6) << 5, N, N, 9, N, 2,  //
                 7, N, 3, 4, 4, 4);
  const cv::Mat expected = (cv::Mat_<float>(2, 6) << 5, 5, 5, 9, 2, 2,  //
                            7, 3, 3, 4, 4, 4);
  interpolateBackground(map, RANGE);
  EXPECT_TRUE(equal(map, expected)) << map;
}

TEST(InterpolateBackground, runsAtTheEndsOfARowCopyTheNearestValue) {
  cv::Mat map = (cv::Mat_<float>(1, 6) << N, N, 5, 8, N, N);
  const cv::Mat expected = (cv::Mat_<float>(1, 6) << 5, 5, 5, 8, 8, 8);
  interpolateBackground(map, RANGE);
  EXPECT_TRUE(equal(map, expected)) << map;
}

TEST(InterpolateBackground, rowsAboveAndBelowCopyTheNearestRow) {
  cv::Mat map = (cv::Mat_<float>(5, 3) << N, N, N,  //
                 N, N, N,                           //
                 1, N, 2,                           //
                 N, 4, N,                           //
                 N, N, N);
  const cv::Mat expected = (cv::Mat_<float>(5, 3) << 1, 1, 2,  //
                            1, 1, 2,                           //
                            1, 1, 2,                           //
                            4, 4, 4,                           //
                            4, 4, 4);
  interpolateBackground(map, RANGE);
  EXPECT_TRUE(equal(map, expected)) << map;
}

TEST(InterpolateBackground, anEmptyRowBetweenValidRowsStaysInvalid) {
  cv::Mat map = (cv::Mat_<float>(3, 2) << 1, 2, N, N, 3, 4);
  const cv::Mat expected = map.clone();
  interpolateBackground(map, RANGE);
  EXPECT_TRUE(equal(map, expected)) << map;
}

TEST(InterpolateBackground, fillsWhateverMarksAnInvalidPixel) {
  const DisparityRange shifted{-8.0F, 120.0F};
  const float nan = std::numeric_limits<float>::quiet_NaN();
  cv::Mat map = (cv::Mat_<float>(1, 6) << -9, -8, nan, -3, -100, 7);
  const cv::Mat expected = (cv::Mat_<float>(1, 6) << -8, -8, -8, -3, -3, 7);
  interpolateBackground(map, shifted);
  EXPECT_TRUE(equal(map, expected)) << map;
}

TEST(InterpolateBackground, leavesAnEmptyMapInvalid) {
  cv::Mat map(3, 4, CV_32FC1, cv::Scalar(N));
  const cv::Mat expected = map.clone();
  interpolateBackground(map, RANGE);
  EXPECT_TRUE(equal(map, expected));
}

TEST(InterpolateBackground, worksInsideALargerMap) {
  cv::Mat whole(3, 5, CV_32FC1, cv::Scalar(50));
  cv::Mat map = whole(cv::Rect(1, 1, 3, 1));
  map.setTo(N);
  map.at<float>(0, 1) = 6;
  interpolateBackground(map, RANGE);
  EXPECT_EQ(cv::countNonZero(whole == 6), 3);
  EXPECT_EQ(cv::countNonZero(whole == 50), 12);
}

TEST(ScoreDisparity, countsErrorsStrictlyAboveEachThreshold) {
  const cv::Mat truth = (cv::Mat_<float>(1, 6) << 10, 20, 30, 40, 50, 60);
  const cv::Mat map = (cv::Mat_<float>(1, 6) << 10, 21, 28, 43.5F, 45, 55.5F);  // errors 0, 1, 2, 3.5, 5, 4.5
  const KittiScore score = scoreDisparity(map, RANGE, truth);
  EXPECT_DOUBLE_EQ(score.all.outliers[0], 4.0 / 6);
  EXPECT_DOUBLE_EQ(score.all.outliers[1], 3.0 / 6);
  EXPECT_DOUBLE_EQ(score.all.outliers[2], 3.0 / 6);
  EXPECT_DOUBLE_EQ(score.all.outliers[3], 2.0 / 6);
  EXPECT_DOUBLE_EQ(score.all.outliers[4], 0.0);
  EXPECT_DOUBLE_EQ(score.all.end_point_error, 16.0 / 6);
  EXPECT_EQ(score.est.outliers, score.all.outliers);
  EXPECT_EQ(score.est.end_point_error, score.all.end_point_error);
  EXPECT_EQ(score.density, 1.0);
}

TEST(ScoreDisparity, estimatedPixelsAreThoseBeforeInterpolation) {
  const cv::Mat truth = (cv::Mat_<float>(1, 5) << 10, 10, 10, 0, 10);
  const cv::Mat map = (cv::Mat_<float>(1, 5) << 10, N, 16, 99, N);  // interpolated: 10 10 16 99 99
  const KittiScore score = scoreDisparity(map, RANGE, truth);
  EXPECT_DOUBLE_EQ(score.density, 2.0 / 4);
  EXPECT_DOUBLE_EQ(score.all.end_point_error, (0.0 + 0 + 6 + 89) / 4);
  EXPECT_DOUBLE_EQ(score.all.outliers[2], 2.0 / 4);
  EXPECT_DOUBLE_EQ(score.est.end_point_error, (0.0 + 6) / 2);
  EXPECT_DOUBLE_EQ(score.est.outliers[2], 1.0 / 2);
}

TEST(ScoreDisparity, aPixelLeftInvalidCountsAsMinusOneWhateverMarksIt) {
  const cv::Mat truth = (cv::Mat_<float>(3, 1) << 10, 2, 10);
  const DisparityRange shifted{5.0F, 133.0F};
  for (const float invalid : {4.0F, -50.0F, std::numeric_limits<float>::quiet_NaN()}) {
    const cv::Mat map = (cv::Mat_<float>(3, 1) << 10, invalid, 10);
    const KittiScore score = scoreDisparity(map, shifted, truth);
    EXPECT_DOUBLE_EQ(score.all.end_point_error, (0.0 + 3 + 0) / 3);
    EXPECT_DOUBLE_EQ(score.all.outliers[1], 1.0 / 3);
    EXPECT_DOUBLE_EQ(score.all.outliers[2], 0.0);
    EXPECT_DOUBLE_EQ(score.est.end_point_error, 0.0);
    EXPECT_DOUBLE_EQ(score.density, 2.0 / 3);
  }
}

TEST(ScoreDisparity, anEmptyMapHasNoEstimatedError) {
  const cv::Mat truth = (cv::Mat_<float>(1, 2) << 4, 0);
  const KittiScore score = scoreDisparity(cv::Mat(1, 2, CV_32FC1, cv::Scalar(N)), RANGE, truth);
  EXPECT_EQ(score.density, 0.0);
  EXPECT_EQ(score.all.outliers[3], 1.0);
  EXPECT_EQ(score.all.outliers[4], 0.0);
  EXPECT_EQ(score.all.end_point_error, 5.0);
  EXPECT_EQ(score.est.outliers[0], 0.0);
  EXPECT_EQ(score.est.end_point_error, 0.0);
}

TEST(ScoreDisparity, leavesItsInputAlone) {
  const cv::Mat truth = (cv::Mat_<float>(1, 2) << 4, 5);
  const cv::Mat map = (cv::Mat_<float>(1, 2) << N, 5);
  scoreDisparity(map, RANGE, truth);
  EXPECT_EQ(map.at<float>(0, 0), N);
}

TEST(ScoreDisparity, refusesWhatItCannotCompare) {
  const cv::Mat map(2, 3, CV_32FC1, cv::Scalar(1));
  EXPECT_THROW(scoreDisparity(map, RANGE, cv::Mat(3, 2, CV_32FC1, cv::Scalar(1))), std::invalid_argument);
  EXPECT_THROW(scoreDisparity(map, RANGE, cv::Mat(2, 3, CV_16UC1, cv::Scalar(1))), std::invalid_argument);
  EXPECT_THROW(scoreDisparity(cv::Mat(2, 3, CV_16SC1, cv::Scalar(1)), RANGE, map), std::invalid_argument);
  EXPECT_THROW(scoreDisparity(map, RANGE, cv::Mat(2, 3, CV_32FC1, cv::Scalar(0))), std::invalid_argument);
  EXPECT_THROW(scoreDisparity(cv::Mat(), RANGE, cv::Mat()), std::invalid_argument);
}

TEST(KittiScoreMean, averagesTheRatiosOfTheImages) {
  KittiScore a, b;
  a.all.outliers[2] = 0.1;
  a.all.end_point_error = 1.0;
  a.est.outliers[4] = 0.5;
  a.est.end_point_error = 3.0;
  a.density = 0.5;
  b.all.outliers[2] = 0.3;
  b.all.end_point_error = 2.0;
  b.density = 1.0;
  KittiScoreMean mean;
  EXPECT_EQ(mean.mean().density, 0.0);
  mean.add(a);
  mean.add(b);
  EXPECT_EQ(mean.count(), 2);
  EXPECT_DOUBLE_EQ(mean.mean().all.outliers[2], 0.2);
  EXPECT_DOUBLE_EQ(mean.mean().all.end_point_error, 1.5);
  EXPECT_DOUBLE_EQ(mean.mean().est.outliers[4], 0.25);
  EXPECT_DOUBLE_EQ(mean.mean().est.end_point_error, 1.5);
  EXPECT_DOUBLE_EQ(mean.mean().density, 0.75);
}

}  // namespace
}  // namespace disparity_refinement
