#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "disparity_refinement/visualization/Colorize.hpp"

namespace disparity_refinement {
namespace {

const float NOT_A_NUMBER = std::numeric_limits<float>::quiet_NaN();
const float INFINITE = std::numeric_limits<float>::infinity();
const cv::Vec3b BLACK(0, 0, 0), GREEN(0, 160, 0), YELLOW(0, 255, 255), ORANGE(0, 140, 255), RED(0, 0, 255),
    GREY(128, 128, 128);

using Row = cv::Mat_<float>;

cv::Vec3b at(const cv::Mat& bgr, int x, int y = 0) { return bgr.at<cv::Vec3b>(y, x); }

TEST(ColorizeDisparity, isBlueWhereFarAndRedWhereNear) {
  cv::Mat bgr;
  colorizeDisparity((Row(1, 4) << 10, 30, 50, 70), {0.0F, 128.0F}, 0.0F, 80.0F, bgr);
  ASSERT_EQ(bgr.type(), CV_8UC3);
  EXPECT_GT(at(bgr, 0)[0], at(bgr, 0)[1]);  // Blue
  EXPECT_GT(at(bgr, 0)[0], at(bgr, 0)[2]);
  EXPECT_GT(at(bgr, 1)[1], at(bgr, 1)[2]);  // Green
  EXPECT_GT(at(bgr, 2)[2], at(bgr, 2)[0]);  // Yellow
  EXPECT_GT(at(bgr, 2)[1], at(bgr, 2)[0]);
  EXPECT_GT(at(bgr, 3)[2], at(bgr, 3)[0]);  // Red
  EXPECT_GT(at(bgr, 3)[2], at(bgr, 3)[1]);
}

TEST(ColorizeDisparity, usesTheWholeTurboMap) {
  // The ends of the published table: RGB (0.18995, 0.07176, 0.23217) and (0.47960, 0.01583, 0.01055).
  cv::Mat bgr;
  colorizeDisparity((Row(1, 2) << 10, 60), {0.0F, 128.0F}, 10.0F, 60.0F, bgr);
  EXPECT_LE(cv::norm(at(bgr, 0), cv::Vec3b(59, 18, 48), cv::NORM_INF), 1.0);
  EXPECT_LE(cv::norm(at(bgr, 1), cv::Vec3b(3, 4, 122), cv::NORM_INF), 1.0);
}

TEST(ColorizeDisparity, dividesTheScaleIntoEvenSteps) {
  // A scale of 255 px has one colour a pixel of disparity.
  cv::Mat bgr;
  colorizeDisparity((Row(1, 4) << 110, 111, 110.25F, 110.75F), {0.0F, 300.0F}, 10.0F, 265.0F, bgr);
  EXPECT_NE(at(bgr, 0), at(bgr, 1));
  EXPECT_EQ(at(bgr, 2), at(bgr, 0));
  EXPECT_EQ(at(bgr, 3), at(bgr, 1));
}

TEST(ColorizeDisparity, clampsToTheScale) {
  cv::Mat bgr;
  colorizeDisparity((Row(1, 4) << 3, 10, 60, 200), {0.0F, 128.0F}, 10.0F, 60.0F, bgr);
  EXPECT_EQ(at(bgr, 0), at(bgr, 1));
  EXPECT_EQ(at(bgr, 3), at(bgr, 2));
  EXPECT_NE(at(bgr, 1), at(bgr, 2));
}

TEST(ColorizeDisparity, isBlackWithoutDisparityOnly) {
  cv::Mat bgr;
  colorizeDisparity((Row(1, 6) << 4, 4.5F, NOT_A_NUMBER, INFINITE, -INFINITE, 5), {5.0F, 128.0F}, 10.0F,
                    60.0F, bgr);
  for (int x = 0; x < 5; ++x) EXPECT_EQ(at(bgr, x), BLACK) << x;
  EXPECT_NE(at(bgr, 5), BLACK);
}

TEST(ColorizeDisparity, refusesAnEmptyScale) {
  cv::Mat bgr;
  const Row disparity(1, 1, 5.0F);
  const DisparityRange range;
  EXPECT_THROW(colorizeDisparity(disparity, range, 8.0F, 8.0F, bgr), std::invalid_argument);
  EXPECT_THROW(colorizeDisparity(disparity, range, NOT_A_NUMBER, 8.0F, bgr), std::invalid_argument);
  EXPECT_THROW(colorizeDisparity(disparity, range, 8.0F, INFINITE, bgr), std::invalid_argument);
  EXPECT_THROW(colorizeDisparity(disparity, range, 8.0F, NOT_A_NUMBER, bgr), std::invalid_argument);
  EXPECT_THROW(colorizeDisparity(disparity, range, -3e38F, 3e38F, bgr), std::invalid_argument);
  EXPECT_NO_THROW(colorizeDisparity(disparity, range, 8.0F, 8.5F, bgr));
}

TEST(ColorizeLabels, givesEveryLabelItsColour) {
  cv::Mat labels(1, 5000, CV_32SC1), bgr;
  for (int i = 0; i < labels.cols; ++i) labels.at<int>(0, i) = i;
  colorizeLabels(labels, bgr);
  std::set<std::tuple<int, int, int>> colours;
  for (int i = 0; i < labels.cols; ++i) {
    const cv::Vec3b colour = at(bgr, i);
    colours.emplace(colour[0], colour[1], colour[2]);
    EXPECT_GE(std::min({colour[0], colour[1], colour[2]}), 64);
    EXPECT_GT(cv::norm(colour, at(bgr, i > 0 ? i - 1 : 1)), 60.0) << i;
  }
  EXPECT_EQ(colours.size(), 5000U);

  cv::Mat other = (cv::Mat_<int>(2, 2) << 7, 7, 4999, 0), other_bgr;
  colorizeLabels(other, other_bgr);
  EXPECT_EQ(at(other_bgr, 1, 0), at(bgr, 7));
  EXPECT_EQ(at(other_bgr, 0, 1), at(bgr, 4999));
  EXPECT_EQ(at(other_bgr, 1, 1), at(bgr, 0));
}

TEST(ColorizeLabels, isBlackOutsideTheSegments) {
  cv::Mat bgr;
  colorizeLabels((cv::Mat_<int>(1, 2) << -1, std::numeric_limits<int>::min()), bgr);
  EXPECT_EQ(at(bgr, 0), BLACK);
  EXPECT_EQ(at(bgr, 1), BLACK);
}

TEST(DrawSegmentBorders, marksPixelsBeforeAnotherLabel) {
  const cv::Mat gray(3, 4, CV_8UC1, cv::Scalar(90));
  const cv::Mat labels = (cv::Mat_<int>(3, 4) << 0, 0, 1, 1,  //
                          0, 0, 1, 1,                         //
                          0, 2, 2, 2);
  const cv::Mat border = (cv::Mat_<uchar>(3, 4) << 0, 1, 0, 0,  //
                          0, 1, 1, 1,                           //
                          1, 0, 0, 0);
  cv::Mat bgr;
  drawSegmentBorders(gray, labels, bgr, {1, 2, 3});
  ASSERT_EQ(bgr.type(), CV_8UC3);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 4; ++x) {
      EXPECT_EQ(at(bgr, x, y), border.at<uchar>(y, x) != 0 ? cv::Vec3b(1, 2, 3) : cv::Vec3b(90, 90, 90));
    }
  }
  drawSegmentBorders(gray, labels, bgr);
  EXPECT_EQ(at(bgr, 1, 0), YELLOW);
}

TEST(DrawSegmentBorders, drawsOnColourImagesAndInPlace) {
  cv::Mat image = (cv::Mat_<cv::Vec3b>(1, 3) << cv::Vec3b(1, 2, 3), cv::Vec3b(4, 5, 6), cv::Vec3b(7, 8, 9));
  const cv::Mat labels = (cv::Mat_<int>(1, 3) << 0, 1, 1);
  cv::Mat bgr;
  drawSegmentBorders(image, labels, bgr);
  EXPECT_EQ(at(bgr, 0), YELLOW);
  EXPECT_EQ(at(bgr, 2), cv::Vec3b(7, 8, 9));
  EXPECT_EQ(at(image, 0), cv::Vec3b(1, 2, 3));
  drawSegmentBorders(image, labels, image);
  EXPECT_EQ(cv::norm(image, bgr, cv::NORM_INF), 0.0);
}

std::vector<SegmentPlane> planesOf(const std::vector<PlaneStatus>& statuses) {
  std::vector<SegmentPlane> planes(statuses.size());
  for (std::size_t i = 0; i < statuses.size(); ++i) planes[i].status = statuses[i];
  return planes;
}

const std::vector<PlaneStatus> ALL_STATUSES = {PlaneStatus::ACCEPTED, PlaneStatus::TOO_FEW_POINTS,
                                               PlaneStatus::DEGENERATE, PlaneStatus::MAX_ITERATIONS,
                                               PlaneStatus::OF_NEIGHBOUR};

TEST(RefusalColour, tellsTheReasonsApart) {
  EXPECT_EQ(refusalColour(PlaneStatus::ACCEPTED), BLACK);
  EXPECT_EQ(refusalColour(PlaneStatus::TOO_FEW_POINTS), cv::Vec3b(0, 150, 255));
  EXPECT_EQ(refusalColour(PlaneStatus::DEGENERATE), cv::Vec3b(230, 0, 230));
  EXPECT_EQ(refusalColour(PlaneStatus::MAX_ITERATIONS), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(refusalColour(PlaneStatus::OF_NEIGHBOUR), cv::Vec3b(255, 120, 0));
}

TEST(DrawRefusedSegments, tintsThemByTheirReason) {
  // Columns of two pixels: the right one of each is before another label. The last column has no label.
  cv::Mat gray(1, 12, CV_8UC1), labels(1, 12, CV_32SC1);
  for (int x = 0; x < 12; ++x) {
    gray.at<uchar>(0, x) = static_cast<uchar>(20 * x);
    labels.at<int>(0, x) = x < 10 ? x / 2 : -1;
  }
  cv::Mat bgr;
  drawRefusedSegments(gray, labels, planesOf(ALL_STATUSES), bgr);
  ASSERT_EQ(bgr.type(), CV_8UC3);
  const cv::Vec3b BORDER(200, 200, 200);
  for (int x = 1; x < 10; x += 2) EXPECT_EQ(at(bgr, x), BORDER) << x;
  EXPECT_EQ(at(bgr, 0), BLACK) << "accepted, gray level 0";
  EXPECT_EQ(at(bgr, 2), cv::Vec3b(20, 20 + 75, 20 + 128)) << "too few points, gray level 40";
  EXPECT_EQ(at(bgr, 4), cv::Vec3b(40 + 115, 40, 40 + 115)) << "degenerate, gray level 80";
  EXPECT_EQ(at(bgr, 6), cv::Vec3b(60, 60, 60 + 128)) << "maximum number of iterations, gray level 120";
  EXPECT_EQ(at(bgr, 8), cv::Vec3b(80 + 128, 80 + 60, 80)) << "of a neighbour, gray level 160";
  EXPECT_EQ(at(bgr, 10), cv::Vec3b(200, 200, 200)) << "no segment, gray level 200";
  EXPECT_EQ(at(bgr, 11), cv::Vec3b(220, 220, 220)) << "no segment, gray level 220";
}

TEST(DrawRefusedSegments, leavesAnImageWithoutRefusedSegmentsGray) {
  const cv::Mat gray = (cv::Mat_<uchar>(2, 2) << 1, 2, 3, 255);
  cv::Mat bgr;
  drawRefusedSegments(gray, cv::Mat::zeros(2, 2, CV_32SC1), planesOf({PlaneStatus::ACCEPTED}), bgr);
  for (int i = 0; i < 4; ++i) {
    const uchar level = gray.at<uchar>(i / 2, i % 2);
    EXPECT_EQ(at(bgr, i % 2, i / 2), cv::Vec3b(level, level, level));
  }
}

TEST(DrawRefusedSegments, refusesLabelsWithoutAPlane) {
  const cv::Mat gray(1, 2, CV_8UC1, cv::Scalar(20)), labels = (cv::Mat_<int>(1, 2) << 0, 3);
  cv::Mat bgr;
  try {
    drawRefusedSegments(gray, labels, planesOf({PlaneStatus::ACCEPTED, PlaneStatus::ACCEPTED}), bgr);
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "the largest label is 3, expected less than the number of planes, 2");
  }
  EXPECT_TRUE(bgr.empty());
}

TEST(ColorizeError, followsItsLegend) {
  const Row truth = (Row(1, 10) << 20, 20, 20, 20, 20, 20, 20, 20, 0, 20);
  const Row disparity = (Row(1, 10) << 21, 21.0625F, 18, 17.9375F, 17, 23.0625F, 60, -1, 20, NOT_A_NUMBER);
  cv::Mat bgr;
  colorizeError(disparity, {0.0F, 128.0F}, truth, bgr);
  const cv::Vec3b expected[] = {GREEN, YELLOW, YELLOW, ORANGE, ORANGE, RED, RED, GREY, BLACK, GREY};
  for (int x = 0; x < 10; ++x) EXPECT_EQ(at(bgr, x), expected[x]) << x;
}

TEST(ColorizeError, isBlackWhereTheTruthIsNotANumber) {
  cv::Mat bgr;
  colorizeError(Row(1, 1, 20.0F), {}, Row(1, 1, NOT_A_NUMBER), bgr);
  EXPECT_EQ(at(bgr, 0), BLACK);
}

TEST(Colorize, writesIntoAPictureOfTheRightTypeAndSize) {
  const cv::Mat disparity(3, 4, CV_32FC1, cv::Scalar(20)), labels(3, 4, CV_32SC1, cv::Scalar(0));
  const cv::Mat gray(3, 4, CV_8UC1, cv::Scalar(20));
  cv::Mat large(9, 9, CV_8UC3, cv::Scalar::all(0));
  cv::Mat bgr = large(cv::Rect(2, 3, 4, 3));
  const uchar* const data = bgr.data;
  colorizeDisparity(disparity, {}, 0.0F, 64.0F, bgr);
  EXPECT_EQ(bgr.data, data);
  colorizeLabels(labels, bgr);
  EXPECT_EQ(bgr.data, data);
  drawSegmentBorders(gray, labels, bgr);
  EXPECT_EQ(bgr.data, data);
  drawRefusedSegments(gray, labels, {SegmentPlane()}, bgr);
  EXPECT_EQ(bgr.data, data);
  colorizeError(disparity, {}, disparity, bgr);
  EXPECT_EQ(bgr.data, data);
  EXPECT_EQ(at(large, 2, 3), GREEN);
  EXPECT_EQ(at(large, 6, 3), BLACK);
  EXPECT_EQ(at(large, 5, 6), BLACK);
}

TEST(Colorize, refusesImagesOfAnotherTypeOrSize) {
  const cv::Mat disparity(3, 4, CV_32FC1, cv::Scalar(20)), labels(3, 4, CV_32SC1, cv::Scalar(0));
  const cv::Mat gray(3, 4, CV_8UC1, cv::Scalar(20));
  cv::Mat bgr;
  EXPECT_THROW(colorizeDisparity(gray, {}, 0.0F, 64.0F, bgr), std::invalid_argument);
  EXPECT_THROW(colorizeDisparity(cv::Mat(), {}, 0.0F, 64.0F, bgr), std::invalid_argument);
  EXPECT_THROW(colorizeLabels(disparity, bgr), std::invalid_argument);
  EXPECT_THROW(colorizeLabels(cv::Mat(), bgr), std::invalid_argument);
  EXPECT_THROW(drawSegmentBorders(disparity, labels, bgr), std::invalid_argument);
  EXPECT_THROW(drawSegmentBorders(gray, gray, bgr), std::invalid_argument);
  EXPECT_THROW(drawSegmentBorders(gray, labels.colRange(0, 3), bgr), std::invalid_argument);
  const std::vector<SegmentPlane> planes(1);
  EXPECT_THROW(drawRefusedSegments(disparity, labels, planes, bgr), std::invalid_argument);
  EXPECT_THROW(drawRefusedSegments(gray, gray, planes, bgr), std::invalid_argument);
  EXPECT_THROW(drawRefusedSegments(gray, labels.colRange(0, 3), planes, bgr), std::invalid_argument);
  EXPECT_THROW(colorizeError(gray, {}, disparity, bgr), std::invalid_argument);
  EXPECT_THROW(colorizeError(disparity, {}, gray, bgr), std::invalid_argument);
  try {
    colorizeError(disparity, {}, disparity.rowRange(0, 2), bgr);
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "ground_truth is CV_32FC1 of 4x2, expected CV_32FC1 of 4x3, not empty");
  }
  EXPECT_TRUE(bgr.empty());
}

}  // namespace
}  // namespace disparity_refinement
