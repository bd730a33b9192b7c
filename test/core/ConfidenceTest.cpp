#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>

#include "disparity_refinement/refinement/Confidence.hpp"

namespace disparity_refinement {
namespace {

const DisparityRange RANGE{0.0F, 64.0F};
const float HOLE = -1.0F;

int number(DisparitySource source) { return static_cast<int>(source); }

SegmentPlane acceptedPlane(double a, double b, double c) {
  SegmentPlane plane;
  plane.a = a;
  plane.b = b;
  plane.c = c;
  plane.status = PlaneStatus::ACCEPTED;
  return plane;
}

TEST(Confidence, tellsTheSourceOfEveryPixel) {
  // Segment 0 has the plane d = 0.5 x + 10, segment 1 has none.
  const cv::Mat labels = (cv::Mat_<int>(2, 5) << 0, 0, 0, 0, 0, 1, 1, 1, -1, -1);
  const cv::Mat disparity = (cv::Mat_<float>(2, 5) << 10.0F, 20.0F, HOLE, HOLE, HOLE,  //
                             30.0F, 30.0F, HOLE, 7.0F, HOLE);
  const cv::Mat refined = (cv::Mat_<float>(2, 5) << 11.0F, 10.5F, 10.0F, 40.0F, HOLE,  //
                           30.0F, 31.5F, 10.0F, 7.0F, 7.0F);
  cv::Mat sources;
  findSources(disparity, refined, labels, RANGE, {acceptedPlane(0.5, 0.0, 10.0), {}}, sources);
  const cv::Mat expected =
      (cv::Mat_<uchar>(2, 5) << number(DisparitySource::MEASURED), number(DisparitySource::OWN_PLANE),
       number(DisparitySource::OWN_PLANE), number(DisparitySource::NEIGHBOUR_PLANE),
       number(DisparitySource::NONE),  //
       number(DisparitySource::MEASURED), number(DisparitySource::FILLED), number(DisparitySource::FILLED),
       number(DisparitySource::MEASURED), number(DisparitySource::FILLED));
  EXPECT_EQ(cv::countNonZero(sources != expected), 0) << sources;
}

TEST(Confidence, takesWhatIsNoDisparityForAHole) {
  const cv::Mat labels(1, 3, CV_32SC1, cv::Scalar(0));
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const cv::Mat disparity = (cv::Mat_<float>(1, 3) << nan, inf, nan);
  const cv::Mat refined = (cv::Mat_<float>(1, 3) << 5.0F, 5.0F, nan);
  cv::Mat sources;
  findSources(disparity, refined, labels, RANGE, {SegmentPlane()}, sources);
  EXPECT_EQ(sources.at<uchar>(0), number(DisparitySource::FILLED));
  EXPECT_EQ(sources.at<uchar>(1), number(DisparitySource::FILLED));
  EXPECT_EQ(sources.at<uchar>(2), number(DisparitySource::NONE));
}

TEST(Confidence, isTheShareOfMeasuredPixelsAround) {
  cv::Mat sources(41, 61, CV_8UC1, cv::Scalar(number(DisparitySource::OWN_PLANE)));
  sources.colRange(0, 30).setTo(number(DisparitySource::MEASURED));
  sources.at<uchar>(20, 2) = number(DisparitySource::NONE);
  cv::Mat confidence;
  findConfidence(sources, confidence);
  ASSERT_EQ(confidence.type(), CV_8UC1);
  for (int x = 0; x < 61; ++x) {
    for (int y = 0; y < 41; ++y) {
      int measured = 0;
      for (int dy = -10; dy <= 10; ++dy) {
        for (int dx = -10; dx <= 10; ++dx) {
          const int u = std::min(std::max(x + dx, 0), 60), v = std::min(std::max(y + dy, 0), 40);
          measured += sources.at<uchar>(v, u) == number(DisparitySource::MEASURED) ? 1 : 0;
        }
      }
      const double expected = x == 2 && y == 20 ? 0.0 : 255.0 * measured / (21.0 * 21.0);
      EXPECT_NEAR(confidence.at<uchar>(y, x), expected, 0.51) << x << ", " << y;
    }
  }
}

TEST(Confidence, takesTheSmallestImage) {
  cv::Mat confidence;
  findConfidence(cv::Mat(1, 1, CV_8UC1, cv::Scalar(number(DisparitySource::MEASURED))), confidence);
  EXPECT_EQ(confidence.at<uchar>(0), 255);
  findConfidence(cv::Mat(1, 1, CV_8UC1, cv::Scalar(number(DisparitySource::FILLED))), confidence);
  EXPECT_EQ(confidence.at<uchar>(0), 0);
}

TEST(Confidence, writesInPlace) {
  cv::Mat sources(3, 4, CV_8UC1), confidence(3, 4, CV_8UC1);
  const uchar *const sources_data = sources.data, *const confidence_data = confidence.data;
  const cv::Mat map(3, 4, CV_32FC1, cv::Scalar(8.0F)), labels(3, 4, CV_32SC1, cv::Scalar(0));
  findSources(map, map, labels, RANGE, {SegmentPlane()}, sources);
  findConfidence(sources, confidence);
  EXPECT_EQ(sources.data, sources_data);
  EXPECT_EQ(confidence.data, confidence_data);
  EXPECT_EQ(cv::countNonZero(confidence == 255), 12);
}

TEST(Confidence, refusesBadInput) {
  const cv::Mat map(3, 4, CV_32FC1, cv::Scalar(8.0F)), labels(3, 4, CV_32SC1, cv::Scalar(1));
  cv::Mat sources;
  const auto message = [&](const cv::Mat& disparity, const cv::Mat& refined, const cv::Mat& segments) {
    try {
      findSources(disparity, refined, segments, RANGE, {SegmentPlane()}, sources);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_EQ(message(map, map, labels), "the largest label is 1, expected less than the number of planes, 1");
  EXPECT_EQ(message(cv::Mat(), map, labels).substr(0, 13), "disparity is ");
  EXPECT_EQ(message(map, map.colRange(0, 3), labels).substr(0, 11), "refined is ");
  EXPECT_EQ(message(map, map, cv::Mat(3, 4, CV_8UC1)).substr(0, 10), "labels is ");
  EXPECT_THROW(findConfidence(map, sources), std::invalid_argument);
  EXPECT_THROW(findConfidence(cv::Mat(), sources), std::invalid_argument);
}

TEST(Confidence, namesEverySource) {
  for (int i = 0; i < DISPARITY_SOURCES; ++i) {
    EXPECT_STRNE(toString(static_cast<DisparitySource>(i)), "unknown") << i;
  }
}

}  // namespace
}  // namespace disparity_refinement
