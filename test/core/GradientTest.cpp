#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "SegmentationReference.hpp"
#include "disparity_refinement/segmentation/Gradient.hpp"

namespace disparity_refinement {
namespace {

using reference::identical;
using reference::messageOf;

cv::Mat gradientOf(const cv::Mat& gray, const GradientParameters& parameters = {}) {
  cv::Mat gradient;
  Gradient().compute(gray, parameters, gradient);
  return gradient;
}

GradientParameters withoutShadow(StructuringElement element = StructuringElement::CROSS) {
  GradientParameters parameters;
  parameters.structuring_element = element;
  parameters.shadow_enhancement = false;
  return parameters;
}

/// Both pixels have the gradient |a - b|.
cv::Mat_<std::uint8_t> pair(int a, int b) {
  return (cv::Mat_<std::uint8_t>(1, 2) << static_cast<std::uint8_t>(a), static_cast<std::uint8_t>(b));
}

TEST(Gradient, stretchesWeakGradientsInTheShadow) {
  // round(255^0.55 * g^0.45)
  const int expected[][2] = {{0, 0},   {1, 21},   {2, 29},    {5, 43},   {10, 59},
                             {20, 81}, {50, 122}, {200, 229}, {255, 255}};
  for (const auto& [gradient, stretched] : expected) {
    EXPECT_EQ(stretched, gradientOf(pair(0, gradient)).at<std::uint8_t>(0, 0)) << "gradient " << gradient;
  }
}

TEST(Gradient, takesExponentAndThresholdFromTheParameters) {
  GradientParameters parameters;
  parameters.shadow_gamma = 0.5;
  parameters.shadow_threshold = 100;
  // sqrt(255 * 2) = 22.6 up to 100
  EXPECT_EQ(23, gradientOf(pair(100, 98), parameters).at<std::uint8_t>(0, 0));
  EXPECT_EQ(2, gradientOf(pair(101, 99), parameters).at<std::uint8_t>(0, 0));

  parameters.shadow_gamma = 1.0;
  EXPECT_EQ(2, gradientOf(pair(100, 98), parameters).at<std::uint8_t>(0, 0));
}

TEST(Gradient, endsTheShadowAtTheThreshold) {
  const cv::Mat gradient = gradientOf(pair(50, 51));
  EXPECT_EQ(21, gradient.at<std::uint8_t>(0, 0));
  EXPECT_EQ(1, gradient.at<std::uint8_t>(0, 1));
}

TEST(Gradient, judgesTheShadowByTheOriginalGray) {
  // Gradients of 40, below the threshold; the gray of the first pixel is below it, that of the second is not.
  const cv::Mat gradient = gradientOf(pair(45, 85));
  EXPECT_EQ(111, gradient.at<std::uint8_t>(0, 0));  // 21.067 * 40^0.45 = 110.8
  EXPECT_EQ(40, gradient.at<std::uint8_t>(0, 1));
}

TEST(Gradient, isThePlainOneWithoutShadowEnhancement) {
  EXPECT_TRUE(identical(pair(7, 7), gradientOf(pair(0, 7), withoutShadow())));
}

TEST(Gradient, seesDiagonalNeighboursThroughTheSquareOnly) {
  const cv::Mat gray = (cv::Mat_<std::uint8_t>(3, 3) << 200, 100, 100, 100, 100, 100, 100, 100, 90);
  const cv::Mat cross = (cv::Mat_<std::uint8_t>(3, 3) << 100, 100, 0, 100, 0, 10, 0, 10, 10);
  const cv::Mat square = (cv::Mat_<std::uint8_t>(3, 3) << 100, 100, 0, 100, 110, 10, 0, 10, 10);
  EXPECT_TRUE(identical(cross, gradientOf(gray, withoutShadow(StructuringElement::CROSS))));
  EXPECT_TRUE(identical(square, gradientOf(gray, withoutShadow(StructuringElement::SQUARE))));
}

TEST(Gradient, ignoresPixelsOutsideTheImage) {
  for (const int value : {0, 128, 255}) {
    EXPECT_EQ(0, cv::countNonZero(gradientOf(cv::Mat(3, 4, CV_8UC1, cv::Scalar(value)))))
        << "value " << value;
  }
}

TEST(Gradient, ignoresPixelsAroundAPartOfALargerImage) {
  reference::RandomImages images(1);
  for (int i = 0; i < 50; ++i) {
    const cv::Mat gray = images.next();
    for (const int surrounding : {0, 255}) {
      EXPECT_TRUE(identical(gradientOf(gray), gradientOf(reference::insideLarger(gray, surrounding))));
    }
  }
}

TEST(Gradient, isHighestMinusLowestUnderTheElement) {
  reference::RandomImages images(2);
  Gradient gradient;
  cv::Mat actual;
  for (int i = 0; i < 600; ++i) {
    const cv::Mat gray = images.next();
    for (const Connectivity neighbourhood : reference::BOTH_CONNECTIVITIES) {
      const bool cross = neighbourhood == Connectivity::FOUR;
      gradient.compute(gray, withoutShadow(cross ? StructuringElement::CROSS : StructuringElement::SQUARE),
                       actual);
      ASSERT_EQ(gray.size(), actual.size());
      for (const cv::Point p : reference::pixelsOf(gray)) {
        int lowest = gray.at<std::uint8_t>(p);
        int highest = lowest;
        for (const cv::Point q : reference::neighboursOf(gray, p, neighbourhood)) {
          lowest = std::min<int>(lowest, gray.at<std::uint8_t>(q));
          highest = std::max<int>(highest, gray.at<std::uint8_t>(q));
        }
        ASSERT_EQ(highest - lowest, actual.at<std::uint8_t>(p)) << "at " << p << " of\n" << gray;
      }
    }
  }
}

TEST(Gradient, writesIntoAnOutputOfTheRightSize) {
  const cv::Mat gray = pair(0, 10);
  cv::Mat larger(4, 6, CV_8UC1, cv::Scalar(77));
  cv::Mat output = larger(cv::Rect(2, 1, 2, 1));
  const std::uint8_t* data = output.data;
  Gradient().compute(gray, {}, output);
  EXPECT_EQ(data, output.data);
  EXPECT_TRUE(identical(pair(59, 59), output));
  EXPECT_EQ(22, cv::countNonZero(larger == 77)) << "written outside the output";
}

TEST(Gradient, mayReplaceItsInput) {
  cv::Mat gray = (cv::Mat_<std::uint8_t>(1, 3) << 0, 60, 70);
  const cv::Mat expected = (cv::Mat_<std::uint8_t>(1, 3) << 133, 70, 10);  // 21.067 * 60^0.45 = 132.98
  Gradient().compute(gray, {}, gray);
  EXPECT_TRUE(identical(expected, gray));
}

TEST(Gradient, refusesOtherImages) {
  const auto message = [](const cv::Mat& gray) {
    return messageOf<std::invalid_argument>([&] { gradientOf(gray); });
  };
  EXPECT_EQ(0U, message(cv::Mat()).find("gray is "));
  EXPECT_EQ(0U, message(cv::Mat(2, 3, CV_8UC3)).find("gray is CV_8UC3 of 3x2, expected CV_8UC1"));
  EXPECT_NE("", message(cv::Mat(2, 3, CV_16UC1)));
  EXPECT_NE("", message(cv::Mat({2, 3, 4}, CV_8UC1)));
}

TEST(GradientParameters, areValidByDefault) { EXPECT_NO_THROW(validate(GradientParameters())); }

TEST(GradientParameters, areRefusedOutsideTheirRange) {
  const auto message = [](auto change) {
    GradientParameters parameters;
    change(parameters);
    const std::string validated = messageOf<std::invalid_argument>([&] { validate(parameters); });
    const std::string computed =
        messageOf<std::invalid_argument>([&] { gradientOf(pair(1, 2), parameters); });
    EXPECT_EQ(validated, computed);
    return validated;
  };
  using P = GradientParameters;
  EXPECT_EQ("shadow_threshold is -1, expected 0...255", message([](P& p) { p.shadow_threshold = -1; }));
  EXPECT_EQ("shadow_threshold is 256, expected 0...255", message([](P& p) { p.shadow_threshold = 256; }));
  EXPECT_EQ("shadow_gamma is 0, expected greater than 0 and at most 1",
            message([](P& p) { p.shadow_gamma = 0.0; }));
  EXPECT_EQ("shadow_gamma is 1.5, expected greater than 0 and at most 1",
            message([](P& p) { p.shadow_gamma = 1.5; }));
  EXPECT_EQ("shadow_gamma is nan, expected greater than 0 and at most 1",
            message([](P& p) { p.shadow_gamma = std::numeric_limits<double>::quiet_NaN(); }));
  EXPECT_EQ("structuring_element is 2, expected 0 (cross) or 1 (square)",
            message([](P& p) { p.structuring_element = static_cast<StructuringElement>(2); }));

  EXPECT_EQ("", message([](P& p) { p.shadow_threshold = 0; }));
  EXPECT_EQ("", message([](P& p) { p.shadow_threshold = 255; }));
  EXPECT_EQ("", message([](P& p) { p.shadow_gamma = 1.0; }));
}

}  // namespace
}  // namespace disparity_refinement
