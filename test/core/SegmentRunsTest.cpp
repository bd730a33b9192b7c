#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <string>

#include "disparity_refinement/refinement/SegmentRuns.hpp"

namespace disparity_refinement {
namespace {

// "y:x_begin-x_end" of every run of a label.
std::string text(const SegmentRuns& segments, int label) {
  std::string text;
  for (const Run& run : segments[label]) {
    text += std::to_string(run.y) + ":" + std::to_string(run.x_begin) + "-" + std::to_string(run.x_end) + " ";
  }
  return text;
}

TEST(SegmentRuns, listsTheRunsOfEveryLabelInRasterOrder) {
  const cv::Mat labels = (cv::Mat_<int>(3, 4) << 0, 0, 1, 0,  //
                          1, 1, 1, 1,                         //
                          3, 0, 0, -1);
  SegmentRuns segments;
  segments.build(labels);
  ASSERT_EQ(segments.size(), 4);
  EXPECT_EQ(text(segments, 0), "0:0-2 0:3-4 2:1-3 ");
  EXPECT_EQ(text(segments, 1), "0:2-3 1:0-4 ");
  EXPECT_EQ(text(segments, 2), "");
  EXPECT_EQ(text(segments, 3), "2:0-1 ");
}

TEST(SegmentRuns, forgetsTheFormerLabelMap) {
  SegmentRuns segments;
  segments.build((cv::Mat_<int>(2, 3) << 5, 4, 3, 2, 1, 0));
  segments.build((cv::Mat_<int>(1, 2) << 0, 0));
  ASSERT_EQ(segments.size(), 1);
  EXPECT_EQ(text(segments, 0), "0:0-2 ");
}

TEST(SegmentRuns, hasNoSegmentsIfAllLabelsAreNegative) {
  SegmentRuns segments;
  EXPECT_EQ(segments.size(), 0);
  segments.build((cv::Mat_<int>(1, 3) << -1, -7, -1));
  EXPECT_EQ(segments.size(), 0);
}

TEST(SegmentRuns, coversEveryPixelOnceInItsOwnSegment) {
  cv::RNG random(1);
  SegmentRuns segments;
  for (int trial = 0; trial < 100; ++trial) {
    cv::Mat labels(random.uniform(1, 20), random.uniform(1, 20), CV_32SC1);
    random.fill(labels, cv::RNG::UNIFORM, -1, std::min(4, static_cast<int>(labels.total())));
    segments.build(labels);
    cv::Mat covered(labels.size(), CV_32SC1, cv::Scalar(-1));
    int pixels = 0;
    for (int label = 0; label < segments.size(); ++label) {
      for (const auto& run : segments[label]) {
        covered.row(run.y).colRange(run.x_begin, run.x_end).setTo(label);
        pixels += run.x_end - run.x_begin;
      }
    }
    EXPECT_EQ(cv::norm(covered, labels, cv::NORM_INF), 0.0);
    EXPECT_EQ(pixels, cv::countNonZero(labels >= 0));
  }
}

TEST(SegmentRuns, findsARunThatBeginsAtAnyColumn) {
  SegmentRuns segments;
  for (int cols = 2; cols <= 20; ++cols) {
    for (int x = 1; x < cols; ++x) {
      cv::Mat labels = cv::Mat::zeros(2, cols, CV_32SC1);
      labels.row(1).colRange(x, cols).setTo(1);
      segments.build(labels);
      ASSERT_EQ(segments.size(), 2);
      EXPECT_EQ(text(segments, 0), "0:0-" + std::to_string(cols) + " 1:0-" + std::to_string(x) + " ");
      EXPECT_EQ(text(segments, 1), "1:" + std::to_string(x) + "-" + std::to_string(cols) + " ");
    }
  }
}

TEST(SegmentRuns, isTheSameForAnyNumberOfThreads) {
  cv::RNG random(2);
  cv::Mat labels(23, 40, CV_32SC1);
  random.fill(labels, cv::RNG::UNIFORM, -1, 12);
  const int threads_before = cv::getNumThreads();
  cv::setNumThreads(1);
  SegmentRuns expected;
  expected.build(labels);
  for (const int threads : {2, 3, 50}) {
    cv::setNumThreads(threads);
    SegmentRuns segments;
    segments.build(labels);
    ASSERT_EQ(segments.size(), expected.size());
    for (int label = 0; label < segments.size(); ++label) {
      EXPECT_EQ(text(segments, label), text(expected, label)) << threads << " threads";
    }
  }
  cv::setNumThreads(threads_before);
}

TEST(SegmentRuns, keepsTheFormerRunsWhenItRefusesALabelMap) {
  SegmentRuns segments;
  segments.build((cv::Mat_<int>(1, 3) << 1, 1, 0));
  EXPECT_THROW(segments.build((cv::Mat_<int>(1, 4) << 0, 2, 3, 4)), std::invalid_argument);
  ASSERT_EQ(segments.size(), 2);
  EXPECT_EQ(text(segments, 0), "0:2-3 ");
  EXPECT_EQ(text(segments, 1), "0:0-2 ");
}

TEST(SegmentRuns, refusesALabelOfAtLeastTheNumberOfPixels) {
  SegmentRuns segments;
  cv::Mat labels = (cv::Mat_<int>(2, 3) << 0, 0, 0, 0, 5, 0);
  EXPECT_NO_THROW(segments.build(labels));
  labels.at<int>(1, 2) = 6;
  try {
    segments.build(labels);
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "labels is 6 at x = 2, y = 1, expected less than the number of pixels, 6");
  }
  labels.at<int>(0, 1) = 2147483647;
  EXPECT_THROW(segments.build(labels), std::invalid_argument);
}

}  // namespace
}  // namespace disparity_refinement
