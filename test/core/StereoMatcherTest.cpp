#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "disparity_refinement/matching/StereoMatcher.hpp"

namespace disparity_refinement {
namespace {

struct StereoPair {
  cv::Mat left, right;
};

/// A pair whose row y has the disparity of(y); the texture is smooth enough for sub-pixel shifts.
StereoPair texturedPair(const cv::Size& size, const std::function<double(int)>& of) {
  constexpr int MARGIN = 300;
  cv::Mat texture(size.height, size.width + 2 * MARGIN, CV_8UC1);
  cv::RNG(7).fill(texture, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(texture, texture, cv::Size(5, 1), 1.0);
  StereoPair pair{cv::Mat(size, CV_8UC1), cv::Mat(size, CV_8UC1)};
  for (int y = 0; y < size.height; ++y) {
    const uchar* row = texture.ptr<uchar>(y) + MARGIN;
    const double floor = std::floor(of(y)), fraction = of(y) - floor;
    for (int x = 0; x < size.width; ++x) {
      const int x_right = x - static_cast<int>(floor);
      pair.left.at<uchar>(y, x) =
          cv::saturate_cast<uchar>((1.0 - fraction) * row[x_right] + fraction * row[x_right - 1]);
      pair.right.at<uchar>(y, x) = row[x];
    }
  }
  return pair;
}

StereoPair texturedPair(const cv::Size& size, int disparity) {
  return texturedPair(size, [disparity](int) { return disparity; });
}

struct Method {
  StereoAlgorithm algorithm;
  SgbmMode mode;
};

const std::vector<Method> METHODS = {
    {StereoAlgorithm::BM, SgbmMode::SGBM},  {StereoAlgorithm::SGBM, SgbmMode::SGBM},
    {StereoAlgorithm::SGBM, SgbmMode::HH},  {StereoAlgorithm::SGBM, SgbmMode::SGBM_3WAY},
    {StereoAlgorithm::SGBM, SgbmMode::HH4}, {StereoAlgorithm::CENSUS_SGM, SgbmMode::SGBM_3WAY}};
/// Those of OpenCV.
const std::vector<Method> OPENCV_METHODS(METHODS.begin(), METHODS.end() - 1);

std::ostream& operator<<(std::ostream& stream, const Method& method) {
  if (method.algorithm == StereoAlgorithm::BM) return stream << "BM";
  if (method.algorithm == StereoAlgorithm::CENSUS_SGM) return stream << "census SGM";
  return stream << "SGBM mode " << static_cast<int>(method.mode);
}

/// Parameters for small images.
MatchingParameters parametersOf(const Method& method) {
  MatchingParameters p;
  p.stereo_algorithm = method.algorithm;
  p.sgbm_mode = method.mode;
  p.correlation_window_size = method.algorithm == StereoAlgorithm::BM ? 9 : 5;
  p.disparity_range = 64;
  return p;
}

/// Share of the pixels of `map` within `tolerance` of the disparity of their row.
double shareOfRight(const cv::Mat& map, const std::function<double(int)>& of, double tolerance) {
  int right = 0;
  for (int y = 0; y < map.rows; ++y)
    for (int x = 0; x < map.cols; ++x) right += std::abs(map.at<float>(y, x) - of(y)) <= tolerance;
  return static_cast<double>(right) / static_cast<double>(map.total());
}

double shareOfRight(const cv::Mat& map, double disparity) {
  return shareOfRight(
      map, [disparity](int) { return disparity; }, 0.34);
}

/// The part of a map where BM, too, can have a disparity.
cv::Mat interior(const cv::Mat& map, int unmatched_columns) {
  constexpr int BORDER = 8;
  return map(cv::Rect(unmatched_columns + BORDER, BORDER, map.cols - unmatched_columns - 2 * BORDER,
                      map.rows - 2 * BORDER));
}

bool sameBits(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0.0;
}

std::string errorOf(const std::function<void()>& function) {
  try {
    function();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "no error";
}

TEST(StereoMatcher, recoversAConstantDisparity) {
  const StereoPair pair = texturedPair({240, 60}, 23);
  for (const Method& method : METHODS) {
    cv::Mat map;
    StereoMatcher(parametersOf(method)).compute(pair.left, pair.right, map);
    EXPECT_GT(shareOfRight(interior(map, 64), 23.0), 0.99) << method;
  }
}

TEST(StereoMatcher, recoversASlopedDisparity) {
  const auto slope = [](int y) { return 10.0 + 0.25 * y; };
  const StereoPair pair = texturedPair({240, 80}, slope);
  for (const Method& method : METHODS) {
    cv::Mat map;
    StereoMatcher(parametersOf(method)).compute(pair.left, pair.right, map);
    EXPECT_GT(shareOfRight(
                  interior(map, 64), [&slope](int y) { return slope(y + 8); }, 0.6),
              0.97)
        << method;
  }
}

TEST(StereoMatcher, equalsOpenCvWhereThatSearchesFromZero) {
  StereoPair pair = texturedPair({200, 60}, [](int y) { return 5.0 + 0.5 * y; });
  // Weak texture on one side, and noise, so that every parameter decides about some pixels.
  pair.left.colRange(120, 200) *= 0.1;
  pair.right.colRange(100, 200) *= 0.1;
  cv::Mat noise(pair.right.size(), CV_8UC1);
  cv::RNG(11).fill(noise, cv::RNG::UNIFORM, 0, 6);
  pair.right += noise;
  for (const Method& method : OPENCV_METHODS) {
    MatchingParameters p = parametersOf(method);
    p.prefilter_cap = 21;
    p.uniqueness_ratio = 30;
    p.texture_threshold = 500;
    p.P1 = 150;
    p.P2 = 900;
    p.speckle_size = 40;
    p.speckle_range = 3;
    p.disp12MaxDiff = 2;
    cv::Ptr<cv::StereoMatcher> opencv;
    if (method.algorithm == StereoAlgorithm::BM) {
      const auto bm = cv::StereoBM::create(64, 9);
      bm->setPreFilterCap(21);
      bm->setUniquenessRatio(30);
      bm->setTextureThreshold(500);
      bm->setSpeckleWindowSize(40);
      bm->setSpeckleRange(48);
      opencv = bm;
    } else {
      opencv = cv::StereoSGBM::create(0, 64, 5, 150, 900, 2, 21, 30, 40, 3, static_cast<int>(method.mode));
    }
    cv::Mat fixed_point, expected, map;
    opencv->compute(pair.left, pair.right, fixed_point);
    fixed_point.convertTo(expected, CV_32F, 1.0 / 16);
    StereoMatcher(p).compute(pair.left, pair.right, map);
    EXPECT_TRUE(sameBits(map, expected)) << method;
  }
}

TEST(StereoMatcher, equalsTheCensusMatcherAndTheSpeckleFilter) {
  StereoPair pair = texturedPair({200, 60}, [](int y) { return 2.0 + 0.5 * y; });
  cv::Mat noise(pair.right.size(), CV_8UC1);
  cv::RNG(11).fill(noise, cv::RNG::UNIFORM, 0, 60);
  pair.right += noise;
  CensusSgmParameters census;
  census.min_disparity = -3;
  census.disparity_range = 48;
  census.p1 = 9;
  census.p2 = 50;
  census.uniqueness_ratio = 20;
  census.disp12_max_diff = 2;
  census.aggregate_rows = true;
  cv::Mat fixed_point, expected, map, buffer;
  CensusSgm().compute(pair.left, pair.right, census, fixed_point);
  cv::filterSpeckles(fixed_point, CensusSgm::INVALID, 40, 3 * CensusSgm::SUBPIXEL_STEPS, buffer);
  fixed_point.convertTo(expected, CV_32F, 1.0 / CensusSgm::SUBPIXEL_STEPS, -3);

  MatchingParameters p = parametersOf(METHODS.back());
  p.min_disparity = -3;
  p.disparity_range = 48;
  p.P1 = 9;
  p.P2 = 50;
  p.uniqueness_ratio = 20;
  p.disp12MaxDiff = 2;
  p.speckle_size = 40;
  p.speckle_range = 3;
  p.full_width = true;
  p.aggregate_rows = true;
  StereoMatcher(p).compute(pair.left, pair.right, map);
  EXPECT_TRUE(sameBits(map, expected));
  const auto valid = static_cast<std::size_t>(cv::countNonZero(map >= -3.0F));
  EXPECT_GT(valid, map.total() / 10);
  EXPECT_LT(valid, map.total() * 9 / 10);
}

TEST(StereoMatcher, findsDisparitiesFromMinDisparityOn) {
  for (const Method& method : METHODS) {
    for (const int min_disparity : {-100, -64, -20, 5, 40}) {
      MatchingParameters p = parametersOf(method);
      p.min_disparity = min_disparity;
      const int disparity = min_disparity + 11;
      const StereoPair pair = texturedPair({280, 60}, disparity);
      cv::Mat map;
      StereoMatcher(p).compute(pair.left, pair.right, map);

      // The columns of which all candidates lie in the right image.
      const int begin = std::max(min_disparity + 64, 0), end = 280 + std::min(min_disparity, 0);
      EXPECT_GT(shareOfRight(interior(map.colRange(0, end), begin), disparity), 0.99)
          << method << " " << min_disparity;
      const float invalid = static_cast<float>(min_disparity - 1);
      // BM searches one column more.
      if (begin > 1) {
        EXPECT_EQ(cv::countNonZero(map.colRange(0, begin - 1) != invalid), 0)
            << method << " " << min_disparity;
      }
      if (end < 280) {
        EXPECT_EQ(cv::countNonZero(map.colRange(end, 280) != invalid), 0) << method << " " << min_disparity;
      }
    }
  }
}

TEST(StereoMatcher, fullWidthFillsTheLeftStrip) {
  for (const Method& method : METHODS) {
    for (const int min_disparity : {-100, -20, 0, 8}) {
      const int disparity = min_disparity + 11;
      const StereoPair pair = texturedPair({240, 60}, disparity);
      MatchingParameters p = parametersOf(method);
      p.min_disparity = min_disparity;
      cv::Mat map;
      StereoMatcher(p).compute(pair.left, pair.right, map);
      const cv::Rect strip(std::max(disparity, 0) + 8, 8, 30, 44);
      if (min_disparity + 64 > strip.x + strip.width) {
        EXPECT_EQ(shareOfRight(map(strip), disparity), 0.0);
      }
      p.full_width = true;
      StereoMatcher(p).compute(pair.left, pair.right, map);
      EXPECT_EQ(map.size(), pair.left.size());
      EXPECT_GT(shareOfRight(map(strip), disparity), 0.99) << method << " " << min_disparity;
      const cv::Rect right_end(240 + std::min(disparity, 0) - 28, 8, 20, 44);
      EXPECT_GT(shareOfRight(map(right_end), disparity), 0.95) << method << " " << min_disparity;
    }
  }
}

TEST(StereoMatcher, imagesMayBePartsOfLargerOnes) {
  const StereoPair pair = texturedPair({240, 60}, 23);
  const cv::Rect part(20, 10, 200, 40);
  for (const Method& method : METHODS) {
    MatchingParameters p = parametersOf(method);
    p.full_width = true;
    cv::Mat map, expected;
    StereoMatcher(p).compute(pair.left(part), pair.right(part), map);
    StereoMatcher(p).compute(pair.left(part).clone(), pair.right(part).clone(), expected);
    EXPECT_TRUE(sameBits(map, expected)) << method;
  }
}

TEST(StereoMatcher, rangeIsShiftedByThePrincipalPoints) {
  MatchingParameters p;
  p.min_disparity = -16;
  p.disparity_range = 64;
  const StereoMatcher matcher(p);
  EXPECT_EQ(matcher.range().min, -16.0F);
  EXPECT_EQ(matcher.range().max, 48.0F);
  EXPECT_EQ(matcher.range(2.5).min, -18.5F);
  EXPECT_EQ(matcher.range(2.5).max, 45.5F);
  EXPECT_EQ(matcher.range(2.5).invalid(), -19.5F);
}

TEST(StereoMatcher, subtractsThePrincipalPointOffset) {
  const StereoPair pair = texturedPair({240, 60}, 23);
  for (const Method& method : METHODS) {
    StereoMatcher matcher(parametersOf(method));
    cv::Mat plain, shifted;
    matcher.compute(pair.left, pair.right, plain);
    matcher.compute(pair.left, pair.right, shifted, -3.75);
    cv::Mat expected = plain + 3.75;  // the invalid value -1 becomes 2.75 = range.min - 1 as well
    EXPECT_TRUE(sameBits(shifted, expected)) << method;
  }
}

TEST(StereoMatcher, refusesPrincipalPointsThatAreFarApart) {
  const StereoPair pair = texturedPair({240, 60}, 24);
  for (const Method& method : METHODS) {
    StereoMatcher matcher(parametersOf(method));
    cv::Mat disparity;
    for (const double offset : {1e7, -1e30, 1e300, std::nan(""), static_cast<double>(INFINITY)}) {
      EXPECT_THROW(matcher.compute(pair.left, pair.right, disparity, offset), std::invalid_argument)
          << method << " " << offset;
    }
    matcher.compute(pair.left, pair.right, disparity, -1e6);
    const DisparityRange range = matcher.range(-1e6);
    EXPECT_GT(cv::countNonZero(disparity == range.invalid()), 0) << method;
    EXPECT_EQ(cv::countNonZero((disparity >= range.min) & (disparity <= range.max)),
              static_cast<int>(disparity.total()) - cv::countNonZero(disparity == range.invalid()))
        << method;
  }
}

TEST(StereoMatcher, everyPixelIsInvalidOrInRange) {
  StereoPair noise{cv::Mat(60, 200, CV_8UC1), cv::Mat(60, 200, CV_8UC1)};
  cv::RNG rng(3);
  rng.fill(noise.left, cv::RNG::UNIFORM, 0, 256);
  rng.fill(noise.right, cv::RNG::UNIFORM, 0, 256);
  for (const Method& method : METHODS) {
    for (const bool full_width : {false, true}) {
      MatchingParameters p = parametersOf(method);
      p.min_disparity = -7;
      p.disparity_range = 16;
      p.uniqueness_ratio = 0;
      p.speckle_size = 0;
      p.disp12MaxDiff = -1;
      p.full_width = full_width;
      StereoMatcher matcher(p);
      for (const double offset : {0.0, 1.0 / 3.0, -1234.56789}) {
        cv::Mat map;
        matcher.compute(noise.left, noise.right, map, offset);
        const DisparityRange range = matcher.range(offset);
        int valid = 0, wrong = 0;
        for (int y = 0; y < map.rows; ++y) {
          for (int x = 0; x < map.cols; ++x) {
            const float d = map.at<float>(y, x);
            valid += range.isValid(d);
            wrong += d != range.invalid() && !(d >= range.min && d <= range.max);
          }
        }
        EXPECT_EQ(wrong, 0) << method << " " << offset;
        EXPECT_GT(valid, 1000) << method << " " << offset;
      }
    }
  }
}

TEST(StereoMatcher, keepsOneInvalidPixelInAFullMap) {
  const StereoPair pair = texturedPair({120, 40}, 0);
  for (const StereoAlgorithm algorithm : {StereoAlgorithm::SGBM, StereoAlgorithm::CENSUS_SGM}) {
    MatchingParameters p;
    p.stereo_algorithm = algorithm;
    p.sgbm_mode = SgbmMode::SGBM;
    p.disparity_range = 16;
    p.uniqueness_ratio = 0;
    p.speckle_size = 0;
    p.disp12MaxDiff = -1;
    p.full_width = true;
    cv::Mat map;
    StereoMatcher(p).compute(pair.left, pair.right, map);
    EXPECT_EQ(cv::countNonZero(map == -1.0F), 1);
    EXPECT_EQ(map.at<float>(0, 0), -1.0F);
  }
}

TEST(StereoMatcher, speckleRangeIsInPixelsForAllAlgorithms) {
  // A patch 4 px nearer than its surroundings: a region of its own unless such steps are allowed.
  StereoPair pair = texturedPair({200, 60}, 20);
  const StereoPair near = texturedPair({200, 60}, 24);
  const cv::Rect patch(130, 20, 20, 16);
  near.left(patch).copyTo(pair.left(patch));
  for (const Method& method : METHODS) {
    MatchingParameters p = parametersOf(method);
    p.correlation_window_size = 5;
    // Otherwise CENSUS_SGM would take the step in several smaller ones.
    if (method.algorithm == StereoAlgorithm::CENSUS_SGM) {
      p.P1 = 60;
      p.P2 = 75;
    }
    p.speckle_size = 600;
    const auto patchPixels = [&p, &pair, &patch](int speckle_range) {
      p.speckle_range = speckle_range;
      cv::Mat map;
      StereoMatcher(p).compute(pair.left, pair.right, map);
      return cv::countNonZero(cv::abs(map(patch) - 24.0) < 0.25);
    };
    EXPECT_GT(patchPixels(5), 200) << method;
    EXPECT_EQ(patchPixels(2), 0) << method;
  }
}

TEST(StereoMatcher, minusOneSwitchesTheLeftRightCheckOff) {
  // A near patch hides some of the far texture from the right camera: matches there contradict the right
  // view.
  const StereoPair far = texturedPair({240, 60}, 10), near = texturedPair({240, 60}, 34);
  const cv::Rect patch(130, 10, 40, 40);
  StereoPair pair{far.left.clone(), far.right.clone()};
  near.left(patch).copyTo(pair.left(patch));
  const cv::Rect patch_right = patch - cv::Point(34, 0);
  near.right(patch_right).copyTo(pair.right(patch_right));
  for (const Method& method : METHODS) {
    if (method.algorithm == StereoAlgorithm::BM) continue;
    MatchingParameters p = parametersOf(method);
    p.uniqueness_ratio = 0;
    p.speckle_size = 0;
    const auto validPixels = [&p, &pair](int disp12_max_diff) {
      p.disp12MaxDiff = disp12_max_diff;
      cv::Mat map;
      StereoMatcher(p).compute(pair.left, pair.right, map);
      return cv::countNonZero(map >= 0.0F);
    };
    EXPECT_GT(validPixels(-1), validPixels(1) + 50) << method;
  }
}

TEST(StereoMatcher, writesInPlace) {
  const StereoPair pair = texturedPair({240, 60}, 23);
  for (const Method& method : METHODS) {
    StereoMatcher matcher(parametersOf(method));
    cv::Mat expected;
    matcher.compute(pair.left, pair.right, expected);

    cv::Mat map(60, 240, CV_32FC1, cv::Scalar(-7));
    const uchar* data = map.data;
    matcher.compute(pair.left, pair.right, map);
    EXPECT_EQ(map.data, data);
    EXPECT_TRUE(sameBits(map, expected));

    cv::Mat whole(70, 250, CV_32FC1, cv::Scalar(-7));
    cv::Mat part = whole(cv::Rect(4, 3, 240, 60));
    data = part.data;
    matcher.compute(pair.left, pair.right, part);
    EXPECT_EQ(part.data, data);
    EXPECT_TRUE(sameBits(whole(cv::Rect(4, 3, 240, 60)), expected));
    EXPECT_EQ(cv::countNonZero(whole == -7.0F), 70 * 250 - 60 * 240);
  }
}

TEST(StereoMatcher, isTheSameForAnyNumberOfThreads) {
  const StereoPair pair = texturedPair({320, 200}, [](int y) { return 5.0 + 0.21 * y; });
  const int threads_before = cv::getNumThreads();
  for (const Method& method : METHODS) {
    MatchingParameters p = parametersOf(method);
    p.full_width = true;
    p.min_disparity = 3;
    cv::Mat expected;
    for (const int threads : {1, 2, 3, 4}) {
      cv::setNumThreads(threads);
      cv::Mat map;
      StereoMatcher(p).compute(pair.left, pair.right, map);
      if (threads == 1) expected = map;
      EXPECT_TRUE(sameBits(map, expected)) << method << " " << threads;
    }
  }
  cv::setNumThreads(threads_before);
}

TEST(StereoMatcher, reusedObjectsEqualFreshOnes) {
  const std::vector<StereoPair> pairs = {texturedPair({240, 60}, 23), texturedPair({160, 90}, 31),
                                         texturedPair({241, 37}, 5), texturedPair({240, 60}, 40)};
  StereoMatcher reused;
  for (const Method& method : METHODS) {
    for (const bool full_width : {true, false}) {
      MatchingParameters p = parametersOf(method);
      p.full_width = full_width;
      reused.setParameters(p);
      for (const StereoPair& pair : pairs) {
        cv::Mat map, expected;
        reused.compute(pair.left, pair.right, map);
        StereoMatcher(p).compute(pair.left, pair.right, expected);
        EXPECT_TRUE(sameBits(map, expected)) << method << " " << pair.left.size();
      }
    }
  }
}

TEST(StereoMatcher, validWindowLeavesOutWhatLacksCandidates) {
  MatchingParameters parameters;
  parameters.disparity_range = 64;
  parameters.correlation_window_size = 5;
  const cv::Size size(200, 100);
  // 63 columns without all candidates, then half a window on each side.
  EXPECT_EQ(StereoMatcher(parameters).validWindow(size), cv::Rect(65, 2, 133, 96));
  parameters.full_width = true;
  EXPECT_EQ(StereoMatcher(parameters).validWindow(size), cv::Rect(2, 2, 196, 96));
  // The window of the census is 9 px wide, whatever the block is.
  parameters.stereo_algorithm = StereoAlgorithm::CENSUS_SGM;
  EXPECT_EQ(StereoMatcher(parameters).validWindow(size), cv::Rect(4, 4, 192, 92));
  parameters.full_width = false;
  EXPECT_EQ(StereoMatcher(parameters).validWindow(size), cv::Rect(67, 4, 129, 92));
  EXPECT_EQ(StereoMatcher(parameters).validWindow({40, 3}).area(), 0);
}

TEST(StereoMatcher, refusedParametersLeaveTheFormerOnes) {
  const StereoPair pair = texturedPair({240, 60}, 23);
  MatchingParameters p = parametersOf(METHODS[1]);
  StereoMatcher matcher(p);
  cv::Mat expected, map;
  matcher.compute(pair.left, pair.right, expected);
  p.disparity_range = 32;
  p.uniqueness_ratio = 100;
  EXPECT_THROW(matcher.setParameters(p), std::invalid_argument);
  EXPECT_EQ(matcher.parameters().disparity_range, 64);
  EXPECT_EQ(matcher.range().max, 64.0F);
  matcher.compute(pair.left, pair.right, map);
  EXPECT_TRUE(sameBits(map, expected));
}

TEST(StereoMatcher, worksAtTheSmallestSizesItAccepts) {
  // One row and one column less are refused: there OpenCV accesses memory that is not the image's.
  for (const Method& method : OPENCV_METHODS) {
    for (const int window : {5, 11}) {
      const bool bm = method.algorithm == StereoAlgorithm::BM;
      const int stripes_height = window == 5 ? 13 : 25;  // stripes of 4 and 7 rows
      const int height = bm ? window + 1 : method.mode == SgbmMode::SGBM_3WAY ? stripes_height : 1;
      for (const int min_disparity : {-40, -5, 0, 5}) {
        const int width = std::max(32 + std::max(min_disparity, 0), -min_disparity) + window;
        for (const bool full_width : {false, true}) {
          MatchingParameters p;
          p.stereo_algorithm = method.algorithm;
          p.sgbm_mode = method.mode;
          p.correlation_window_size = window;
          p.min_disparity = min_disparity;
          p.disparity_range = 32;
          p.full_width = full_width;
          StereoMatcher matcher(p);
          const StereoPair pair = texturedPair({width, height}, min_disparity + 4);
          cv::Mat map;
          matcher.compute(pair.left, pair.right, map);
          EXPECT_EQ(map.size(), pair.left.size());

          const std::string narrow = errorOf(
              [&] { matcher.compute(pair.left.colRange(1, width), pair.right.colRange(1, width), map); });
          EXPECT_NE(narrow.find("width of the images is " + std::to_string(width - 1) +
                                ", expected at least " + std::to_string(width)),
                    std::string::npos)
              << narrow;
          if (height == 1) continue;
          const std::string low = errorOf(
              [&] { matcher.compute(pair.left.rowRange(1, height), pair.right.rowRange(1, height), map); });
          EXPECT_NE(low.find("height of the images is " + std::to_string(height - 1) +
                             ", expected at least " + std::to_string(height)),
                    std::string::npos)
              << low;
        }
      }
    }
  }
}

TEST(StereoMatcher, censusSgmTakesImagesOfAnySize) {
  MatchingParameters p = parametersOf(METHODS.back());
  StereoMatcher matcher;
  for (const int min_disparity : {-80, -5, 0, 5}) {
    for (const bool full_width : {false, true}) {
      p.min_disparity = min_disparity;
      p.full_width = full_width;
      matcher.setParameters(p);
      for (const cv::Size& size : {cv::Size(1, 1), cv::Size(1, 40), cv::Size(58, 2)}) {
        const StereoPair pair = texturedPair(size, 0);
        cv::Mat map;
        matcher.compute(pair.left, pair.right, map);
        ASSERT_EQ(map.size(), size);
        const float invalid = matcher.range().invalid();
        const int valid = static_cast<int>(map.total()) - cv::countNonZero(map == invalid);
        EXPECT_EQ(cv::countNonZero(map >= matcher.range().min), valid) << size;
        if (!full_width) {
          EXPECT_EQ(valid, 0) << size << ": no column has all candidates";
        }
      }
    }
  }
}

TEST(StereoMatcher, rowsStayInPlaceInLowImages) {
  for (const Method& method : METHODS) {
    if (method.algorithm == StereoAlgorithm::BM) continue;  // leaves half a window empty above and below
    for (const int height : {13, 14, 15, 16, 17, 21}) {
      const int middle = height / 2;
      const auto step = [middle](int y) { return y < middle ? 8.0 : 30.0; };
      const StereoPair pair = texturedPair({240, height}, step);
      MatchingParameters p = parametersOf(method);
      p.speckle_size = 0;
      cv::Mat map;
      StereoMatcher(p).compute(pair.left, pair.right, map);
      for (int y = 0; y < height; ++y) {
        if (y >= middle - 2 && y < middle + 2) continue;  // the block sees both
        EXPECT_GT(shareOfRight(map(cv::Rect(80, y, 150, 1)), step(y)), 0.9)
            << method << " " << height << " row " << y;
      }
    }
  }
}

TEST(StereoMatcher, errorsNameWhatIsWrongWithTheImages) {
  const cv::Mat gray(60, 240, CV_8UC1, cv::Scalar(0));
  StereoMatcher matcher(parametersOf(METHODS[3]));
  cv::Mat map;
  const auto error = [&](const cv::Mat& left, const cv::Mat& right) {
    return errorOf([&] { matcher.compute(left, right, map); });
  };
  EXPECT_EQ(error(cv::Mat(), gray), "left is CV_8UC1 of 0x0, expected CV_8UC1 of 0x0, not empty");
  EXPECT_EQ(error(gray, cv::Mat()), "right is CV_8UC1 of 0x0, expected CV_8UC1 of 240x60, not empty");
  EXPECT_EQ(error(cv::Mat(60, 240, CV_8UC3), gray),
            "left is CV_8UC3 of 240x60, expected CV_8UC1 of 240x60, not empty");
  EXPECT_EQ(error(gray, cv::Mat(60, 240, CV_16UC1)),
            "right is CV_16UC1 of 240x60, expected CV_8UC1 of 240x60, not empty");
  EXPECT_EQ(error(gray, gray.colRange(0, 239)),
            "right is CV_8UC1 of 239x60, expected CV_8UC1 of 240x60, not empty");
  EXPECT_EQ(error(gray.colRange(0, 63), gray.colRange(0, 63)),
            "width of the images is 63, expected at least 69 for disparity_range 64, min_disparity 0 and "
            "correlation_window_size 5");
  EXPECT_EQ(error(gray.rowRange(0, 3), gray.rowRange(0, 3)),
            "height of the images is 3, expected at least 13 for correlation_window_size 5");
  EXPECT_TRUE(map.empty());

  MatchingParameters p = parametersOf(METHODS[0]);
  p.correlation_window_size = 61;
  matcher.setParameters(p);
  EXPECT_EQ(error(gray, gray),
            "height of the images is 60, expected at least 62 for correlation_window_size 61");
}

struct Limits {
  const char* name;
  int MatchingParameters::*member;
  std::vector<int> good, bad;
};

void expectLimits(const MatchingParameters& base, const std::vector<Limits>& limits) {
  for (const Limits& limit : limits) {
    MatchingParameters p = base;
    for (const int value : limit.good) {
      p.*limit.member = value;
      EXPECT_NO_THROW(validate(p)) << limit.name << " " << value;
    }
    for (const int value : limit.bad) {
      p.*limit.member = value;
      const std::string start = std::string(limit.name) + " is " + std::to_string(value) + ", expected ";
      EXPECT_EQ(errorOf([&p] { validate(p); }).substr(0, start.size()), start);
    }
  }
}

TEST(MatchingParameters, defaultsAreValid) { EXPECT_NO_THROW(validate(MatchingParameters())); }

TEST(MatchingParameters, limitsOfAllAlgorithms) {
  for (const Method& method : METHODS) {
    expectLimits(
        parametersOf(method),
        {{"min_disparity", &MatchingParameters::min_disparity, {-2048, 2048}, {-2049, 2049}},
         {"disparity_range", &MatchingParameters::disparity_range, {16, 32, 2048}, {0, 8, 24, 2064, -16}},
         {"uniqueness_ratio", &MatchingParameters::uniqueness_ratio, {0, 99}, {-1, 100}},
         {"speckle_size", &MatchingParameters::speckle_size, {0, 100000}, {-1}},
         {"speckle_range", &MatchingParameters::speckle_range, {0, 4096}, {-1, 4097}}});
  }
  for (const Method& method : OPENCV_METHODS) {
    expectLimits(parametersOf(method),
                 {{"prefilter_cap", &MatchingParameters::prefilter_cap, {1, 63}, {0, 64}}});
  }
}

TEST(MatchingParameters, limitsOfBm) {
  expectLimits(
      parametersOf(METHODS[0]),
      {{"correlation_window_size", &MatchingParameters::correlation_window_size, {5, 255}, {3, 6, 257}},
       {"prefilter_size", &MatchingParameters::prefilter_size, {5, 255}, {3, 6, 257}},
       {"texture_threshold", &MatchingParameters::texture_threshold, {0, 10000}, {-1, 10001}},
       {"P1", &MatchingParameters::P1, {-1, 100000}, {}}});  // not BM's
}

TEST(MatchingParameters, limitsOfSgbm) {
  expectLimits(
      parametersOf(METHODS[1]),
      {{"correlation_window_size", &MatchingParameters::correlation_window_size, {1, 15}, {0, -1, 4, 17}},
       {"P1", &MatchingParameters::P1, {0, 1, 799}, {-1}},
       {"P2", &MatchingParameters::P2, {0, 201, 16383}, {-1, 200, 16384}},
       {"disp12MaxDiff", &MatchingParameters::disp12MaxDiff, {-1, 0, 4096}, {-2, 4097}},
       {"texture_threshold", &MatchingParameters::texture_threshold, {-1, 10001}, {}}});  // BM's
}

TEST(MatchingParameters, limitsOfCensusSgm) {
  expectLimits(parametersOf(METHODS.back()),
               {{"P1", &MatchingParameters::P1, {0, 1, 49}, {-1}},
                {"P2", &MatchingParameters::P2, {0, 7, 224}, {-1, 6, 225, 16383}},
                {"disp12MaxDiff", &MatchingParameters::disp12MaxDiff, {-1, 0, 4096}, {-2, 4097}},
                // Those of OpenCV's matchers.
                {"correlation_window_size", &MatchingParameters::correlation_window_size, {-1, 4, 257}, {}},
                {"prefilter_size", &MatchingParameters::prefilter_size, {4}, {}},
                {"prefilter_cap", &MatchingParameters::prefilter_cap, {0, 64}, {}},
                {"texture_threshold", &MatchingParameters::texture_threshold, {-1}, {}}});
}

TEST(MatchingParameters, penaltiesOfZeroComeFromTheWindow) {
  MatchingParameters p;  // window 5: 200 and 800
  p.P1 = 800;
  EXPECT_EQ(errorOf([&p] { validate(p); }),
            "P2 is 800, expected more than P1, which is 800, and at most 16383");
  p.P1 = 0;
  p.P2 = 200;
  EXPECT_EQ(errorOf([&p] { validate(p); }),
            "P2 is 200, expected more than P1, which is 200, and at most 16383");

  const StereoPair pair = texturedPair({160, 40}, [](int y) { return 5.0 + 0.7 * y; });
  p.disparity_range = 48;
  p.P1 = 200;
  p.P2 = 800;
  cv::Mat expected, map;
  StereoMatcher(p).compute(pair.left, pair.right, expected);
  p.P1 = p.P2 = 0;
  StereoMatcher(p).compute(pair.left, pair.right, map);
  EXPECT_TRUE(sameBits(map, expected));
}

TEST(MatchingParameters, penaltiesOfZeroAreThoseOfTheCensusMatcher) {
  MatchingParameters p = parametersOf(METHODS.back());
  p.P1 = 50;
  EXPECT_EQ(errorOf([&p] { validate(p); }), "P2 is 50, expected more than P1, which is 50");
  p.P1 = 0;
  p.P2 = 6;
  EXPECT_EQ(errorOf([&p] { validate(p); }), "P2 is 6, expected more than P1, which is 6");

  const StereoPair pair = texturedPair({160, 40}, [](int y) { return 5.0 + 0.7 * y; });
  p.P1 = 6;
  p.P2 = 50;
  cv::Mat expected, map;
  StereoMatcher(p).compute(pair.left, pair.right, expected);
  p.P1 = p.P2 = 0;
  StereoMatcher(p).compute(pair.left, pair.right, map);
  EXPECT_TRUE(sameBits(map, expected));
}

TEST(MatchingParameters, unknownAlgorithmsAreRefused) {
  MatchingParameters p;
  p.stereo_algorithm = static_cast<StereoAlgorithm>(3);
  EXPECT_EQ(errorOf([&p] { validate(p); }), "stereo_algorithm is 3, expected 0...2");
  p.stereo_algorithm = StereoAlgorithm::SGBM;
  p.sgbm_mode = static_cast<SgbmMode>(4);
  EXPECT_EQ(errorOf([&p] { validate(p); }), "sgbm_mode is 4, expected 0...3");
}

}  // namespace
}  // namespace disparity_refinement
