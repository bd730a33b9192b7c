#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/utility.hpp>
#include <stdexcept>
#include <string>

#include "disparity_refinement/evaluation/SyntheticStreet.hpp"

namespace disparity_refinement {
namespace {

StreetParameters smallStreet() {
  StreetParameters parameters;
  parameters.width = 320;
  parameters.height = 120;
  parameters.focal_length = 200.0;
  return parameters;
}

StreetParameters withoutNoise(StreetParameters parameters) {
  parameters.noise = 0.0;
  return parameters;
}

/// A frame of the default size, rendered once.
const StreetFrame& frameOfDefaultSize() {
  static const StreetFrame frame = SyntheticStreet().render(0);
  return frame;
}

bool areEqual(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0.0;
}

bool areEqual(const StreetFrame& a, const StreetFrame& b) {
  return areEqual(a.left, b.left) && areEqual(a.right, b.right) && areEqual(a.disparity, b.disparity);
}

/// Gray value of a row between two pixels.
double interpolated(const cv::Mat& image, int y, double x) {
  const int left = static_cast<int>(std::floor(x));
  const int right = std::min(left + 1, image.cols - 1);
  const double share = x - left;
  return (1.0 - share) * image.at<uchar>(y, left) + share * image.at<uchar>(y, right);
}

/// Share of the pixels with a disparity whose gray value is found in the right image, within `tolerance`,
/// where the disparity plus `shift` says.
double shareFound(const StreetFrame& frame, double shift, double tolerance) {
  int found = 0, all = 0;
  for (int y = 0; y < frame.left.rows; ++y) {
    for (int x = 0; x < frame.left.cols; ++x) {
      const double d = frame.disparity.at<float>(y, x), right_x = x - d - shift;
      if (d == 0.0 || right_x < 0.0) continue;
      ++all;
      found +=
          std::abs(frame.left.at<uchar>(y, x) - interpolated(frame.right, y, right_x)) <= tolerance ? 1 : 0;
    }
  }
  return static_cast<double>(found) / all;
}

TEST(SyntheticStreet, imagesAndTruthHaveTheAskedSize) {
  const StreetFrame frame = SyntheticStreet(smallStreet()).render(0);
  EXPECT_EQ(frame.left.size(), cv::Size(320, 120));
  EXPECT_EQ(frame.right.size(), cv::Size(320, 120));
  EXPECT_EQ(frame.disparity.size(), cv::Size(320, 120));
  EXPECT_EQ(frame.left.type(), CV_8UC1);
  EXPECT_EQ(frame.right.type(), CV_8UC1);
  EXPECT_EQ(frame.disparity.type(), CV_32FC1);
}

TEST(SyntheticStreet, theRoadIsAPlaneOfDisparities) {
  const SyntheticStreet street(smallStreet());
  const StreetParameters& parameters = street.parameters();
  const cv::Point2d centre = street.principalPoint();
  for (const int index : {0, 7, 30}) {
    const StreetFrame frame = street.render(index);
    // The lane ahead is free for 10 m and 1 m to both sides.
    for (int y = 0; y < parameters.height; ++y) {
      const double d = parameters.baseline / SyntheticStreet::CAMERA_HEIGHT * (y - centre.y);
      if (d <= 0.0) continue;
      const double depth = parameters.focal_length * parameters.baseline / d;
      if (depth > 10.0) continue;
      const int reach = static_cast<int>(parameters.focal_length / depth);
      for (const int x : {-reach, -reach / 2, 0, reach / 2, reach}) {
        ASSERT_NEAR(frame.disparity.at<float>(y, static_cast<int>(centre.x) + x), d, 1e-4) << x << ", " << y;
      }
    }
  }
}

TEST(SyntheticStreet, theDisparityLinksTheTwoImages) {
  const SyntheticStreet street(withoutNoise(smallStreet()));
  for (const int index : {0, 12}) {
    const StreetFrame frame = street.render(index);
    EXPECT_GT(shareFound(frame, 0.0, 4.0), 0.9);
    // A disparity that is 2 px off is worse: the check above sees errors.
    EXPECT_LT(shareFound(frame, 2.0, 4.0), shareFound(frame, 0.0, 4.0) - 0.05);
    EXPECT_LT(shareFound(frame, -2.0, 4.0), shareFound(frame, 0.0, 4.0) - 0.05);
  }
}

TEST(SyntheticStreet, everyVisiblePixelHasAFiniteDisparity) {
  const StreetFrame& frame = frameOfDefaultSize();
  const int visible = cv::countNonZero(frame.disparity);
  EXPECT_GT(visible, 0.85 * static_cast<double>(frame.disparity.total()));
  EXPECT_LT(visible, static_cast<int>(frame.disparity.total()));
  // 400 px * 0.5 m: between the distance of the sky and more than a metre.
  EXPECT_EQ(cv::countNonZero(frame.disparity < 0.0F), 0);
  EXPECT_EQ(cv::countNonZero((frame.disparity > 0.0F) & (frame.disparity < 0.99F)), 0);
  EXPECT_EQ(cv::countNonZero(frame.disparity > 200.0F), 0);
  EXPECT_TRUE(cv::checkRange(frame.disparity));
}

TEST(SyntheticStreet, whatTheRightCameraDoesNotSeeHasNoDisparity) {
  const SyntheticStreet street(smallStreet());
  int runs = 0, runs_as_long_as_the_step = 0;
  for (const int index : {0, 5, 10}) {
    const cv::Mat disparity = street.render(index).disparity;
    for (int y = 0; y < disparity.rows; ++y) {
      const float* d = disparity.ptr<float>(y);
      int x = 0;
      // At the left border: what lies left of the right image.
      while (x < disparity.cols && d[x] == 0.0F) ++x;
      for (int i = x; i < disparity.cols; ++i) {
        ASSERT_GE(static_cast<float>(i), d[i]);
      }
      // Inside: behind an object, a strip as wide as the step of the disparity on its left side.
      while (x < disparity.cols) {
        while (x < disparity.cols && d[x] != 0.0F) ++x;
        const int first = x;
        while (x < disparity.cols && d[x] == 0.0F) ++x;
        if (x == disparity.cols) break;
        ++runs;
        const float step = d[x] - d[first - 1];
        runs_as_long_as_the_step += std::abs(static_cast<float>(x - first) - step) <= 1.5F ? 1 : 0;
      }
    }
  }
  ASSERT_GT(runs, 500);
  // Objects narrower than the step have other strips.
  EXPECT_GT(runs_as_long_as_the_step, 0.9 * runs);
}

TEST(SyntheticStreet, visibleSurfacesDoNotCoverEachOtherInTheRightImage) {
  const cv::Mat disparity = SyntheticStreet(smallStreet()).render(5).disparity;
  for (int y = 0; y < disparity.rows; ++y) {
    const float* d = disparity.ptr<float>(y);
    for (int x = 0; x + 1 < disparity.cols; ++x) {
      // Two neighbours on one surface cover the right image between them.
      if (d[x] == 0.0F || d[x + 1] == 0.0F || std::abs(d[x + 1] - d[x]) > 0.3F) continue;
      const float left = static_cast<float>(x) - d[x], right = static_cast<float>(x + 1) - d[x + 1];
      for (int i = 0; i < x; ++i) {
        const float position = static_cast<float>(i) - d[i];
        const bool is_covered = position > left + 0.01F && position < right - 0.01F;
        ASSERT_FALSE(d[i] != 0.0F && d[i] < d[x] - 1.0F && is_covered)
            << i << " behind " << x << " in row " << y;
      }
    }
  }
}

TEST(SyntheticStreet, aFrameIsTheSameForAnyNumberOfThreads) {
  const SyntheticStreet street(smallStreet());
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  const StreetFrame one = street.render(4);
  cv::setNumThreads(5);
  const StreetFrame five = SyntheticStreet(smallStreet()).render(4);
  cv::setNumThreads(threads);
  EXPECT_TRUE(areEqual(one, five));
}

TEST(SyntheticStreet, framesAndSeedsDiffer) {
  const StreetParameters parameters = withoutNoise(smallStreet());
  const StreetFrame frame = SyntheticStreet(parameters).render(0);
  const StreetFrame next = SyntheticStreet(parameters).render(1);
  EXPECT_FALSE(areEqual(frame.left, next.left));
  EXPECT_FALSE(areEqual(frame.disparity, next.disparity));
  StreetParameters other = parameters;
  other.seed = 2;
  EXPECT_FALSE(areEqual(frame.disparity, SyntheticStreet(other).render(0).disparity));
}

TEST(SyntheticStreet, theNoiseHasTheAskedDeviationInBothImages) {
  StreetParameters parameters = smallStreet();
  parameters.noise = 3.0;
  const StreetFrame noisy = SyntheticStreet(parameters).render(2);
  const StreetFrame clean = SyntheticStreet(withoutNoise(parameters)).render(2);
  EXPECT_TRUE(areEqual(noisy.disparity, clean.disparity));

  // Away from black and white, where the noise is cut off.
  const cv::Mat usable = (clean.left > 15) & (clean.left < 240) & (clean.right > 15) & (clean.right < 240);
  ASSERT_GT(cv::countNonZero(usable), 20000);
  cv::Mat left, right;
  cv::subtract(noisy.left, clean.left, left, usable, CV_64F);
  cv::subtract(noisy.right, clean.right, right, usable, CV_64F);
  // Rounding both images to whole gray values adds a variance of 1/12 each.
  const double expected = std::sqrt(9.0 + 2.0 / 12.0);
  for (const cv::Mat& noise : {left, right}) {
    cv::Scalar mean, deviation;
    cv::meanStdDev(noise, mean, deviation, usable);
    EXPECT_NEAR(mean[0], 0.0, 0.05);
    EXPECT_NEAR(deviation[0], expected, 0.05);
  }
  // Independent: the sum of the products is small against the sum of the squares.
  EXPECT_LT(std::abs(left.dot(right)), 0.02 * left.dot(left));
}

TEST(SyntheticStreet, muchOfTheStreetLiesInDarkShadow) {
  const StreetFrame& frame = frameOfDefaultSize();
  const double share = cv::countNonZero(frame.left <= 50) / static_cast<double>(frame.left.total());
  EXPECT_GT(share, 0.2);
  EXPECT_LT(share, 0.7);
}

TEST(SyntheticStreet, blockMatchersLeaveHoles) {
  const StreetFrame& frame = frameOfDefaultSize();
  const auto density = [&](const cv::Ptr<cv::StereoMatcher>& matcher) {
    cv::Mat disparity;
    matcher->compute(frame.left, frame.right, disparity);
    const cv::Mat searched = disparity.colRange(64, disparity.cols);
    return cv::countNonZero(searched >= 0) / static_cast<double>(searched.total());
  };
  const double sgbm =
      density(cv::StereoSGBM::create(0, 64, 5, 200, 800, 1, 63, 10, 100, 2, cv::StereoSGBM::MODE_SGBM_3WAY));
  EXPECT_GT(sgbm, 0.7);
  EXPECT_LT(sgbm, 0.95);
  const double bm = density(cv::StereoBM::create(64, 15));
  EXPECT_GT(bm, 0.2);
  EXPECT_LT(bm, 0.8);
}

TEST(SyntheticStreet, errorsNameTheParameter) {
  const auto error_of = [](const StreetParameters& parameters) -> std::string {
    try {
      SyntheticStreet street(parameters);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  StreetParameters narrow, low, no_focal_length, no_baseline, negative_noise, unknown_noise;
  narrow.width = 63;
  low.height = 47;
  no_focal_length.focal_length = 0.0;
  no_baseline.baseline = -0.5;
  negative_noise.noise = -1.0;
  unknown_noise.noise = nan;
  EXPECT_EQ(error_of(narrow), "width is 63, expected at least 64");
  EXPECT_EQ(error_of(low), "height is 47, expected at least 48");
  EXPECT_EQ(error_of(no_focal_length), "focal_length is 0, expected a positive number");
  EXPECT_EQ(error_of(no_baseline), "baseline is -0.5, expected a positive number");
  EXPECT_EQ(error_of(negative_noise), "noise is -1, expected at least 0");
  EXPECT_EQ(error_of(unknown_noise), "noise is nan, expected at least 0");
  EXPECT_THROW(SyntheticStreet().render(-1), std::invalid_argument);
}

TEST(SyntheticStreet, theSmallestSizeIsRendered) {
  StreetParameters parameters;
  parameters.width = 64;
  parameters.height = 48;
  const StreetFrame frame = SyntheticStreet(parameters).render(0);
  EXPECT_EQ(frame.left.size(), cv::Size(64, 48));
  EXPECT_GT(cv::countNonZero(frame.disparity), 0);
}

}  // namespace
}  // namespace disparity_refinement
