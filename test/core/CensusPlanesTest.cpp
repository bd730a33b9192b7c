#include <gtest/gtest.h>

#include <cstdint>

#include "disparity_refinement/matching/CensusPlanes.hpp"
#include "straightforward/CensusSgm.hpp"

namespace disparity_refinement {
namespace {

/// Both planes of bits, the second one as the upper byte.
cv::Mat bitsOf(const CensusPlanes& planes) {
  cv::Mat bits(planes.census[0].size(), CV_16UC1);
  for (int y = 0; y < bits.rows; ++y) {
    for (int x = 0; x < bits.cols; ++x) {
      bits.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(planes.census[0].at<std::uint8_t>(y, x) |
                                                                planes.census[1].at<std::uint8_t>(y, x) << 8);
    }
  }
  return bits;
}

void expectReference(const CensusPlanes& planes, const cv::Mat& gray) {
  ASSERT_EQ(planes.slope.size(), gray.size());
  ASSERT_EQ(planes.slope.type(), CV_8UC1);
  EXPECT_EQ(cv::norm(bitsOf(planes), straightforward::censusBits(gray), cv::NORM_INF), 0.0) << gray.size();
  EXPECT_EQ(cv::norm(planes.slope, straightforward::censusSlope(gray), cv::NORM_INF), 0.0) << gray.size();
}

cv::Mat randomImage(const cv::Size& size, int gray_levels) {
  static cv::RNG rng(5);
  cv::Mat image(size, CV_8UC1);
  rng.fill(image, cv::RNG::UNIFORM, 0, gray_levels);
  return image;
}

TEST(CensusPlanes, equalTheReferenceForAnySize) {
  CensusPlanes planes;  // keeps its buffers from one size to the next
  for (const int width : {1, 2, 5, 15, 16, 17, 31, 32, 33, 100}) {
    for (const int height : {1, 2, 3, 7, 20}) {
      for (const int gray_levels : {1, 2, 12, 256}) {
        const cv::Mat image = randomImage({width, height}, gray_levels);
        planes.compute(image);
        expectReference(planes, image);
      }
    }
  }
}

TEST(CensusPlanes, areTheSameInAnyNumberOfStrips) {
  for (const int height : {1, 3, 40}) {
    const cv::Mat image = randomImage({50, height}, 256);
    for (const int strips : {1, 2, 3, 7, 64}) {
      CensusPlanes planes;
      planes.compute(image, strips);
      expectReference(planes, image);
    }
  }
}

TEST(CensusPlanes, knowOnlyTheirPartOfALargerImage) {
  const cv::Mat image = randomImage({90, 40}, 256);
  const cv::Rect part(11, 7, 50, 20);
  CensusPlanes planes;
  planes.compute(image(part));
  expectReference(planes, image(part).clone());
}

TEST(CensusPlanes, ofARisingEdgeAndAFlatImage) {
  CensusPlanes planes;
  planes.compute(cv::Mat(20, 30, CV_8UC1, cv::Scalar(77)));
  EXPECT_EQ(cv::countNonZero(bitsOf(planes)), 0) << "nothing is less";
  EXPECT_EQ(cv::countNonZero(planes.slope != 7), 0) << "half of 15";

  cv::Mat edge(20, 30, CV_8UC1, cv::Scalar(10));
  edge.colRange(15, 30) = 200;
  planes.compute(edge);
  EXPECT_EQ(planes.slope.at<std::uint8_t>(9, 14), 15);
  EXPECT_EQ(planes.slope.at<std::uint8_t>(9, 12), 7);
  cv::flip(edge, edge, 1);
  planes.compute(edge);
  EXPECT_EQ(planes.slope.at<std::uint8_t>(9, 14), 0);
}

}  // namespace
}  // namespace disparity_refinement
