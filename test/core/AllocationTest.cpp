// After the first frames of a size the stages allocate nothing.

#include <gtest/gtest.h>

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "../AllocationCounter.hpp"
#include "disparity_refinement/evaluation/SyntheticStreet.hpp"
#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/refinement/PlaneRefinement.hpp"
#include "disparity_refinement/refinement/QualityRefinement.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {
namespace {

std::vector<StreetFrame> streetFrames(int count) {
  StreetParameters parameters;
  parameters.width = 1242;
  parameters.height = 375;
  parameters.focal_length = 721.0;
  parameters.baseline = 0.54;
  const SyntheticStreet street(parameters);
  std::vector<StreetFrame> frames;
  for (int i = 0; i < count; ++i) frames.push_back(street.render(3 * i));
  return frames;
}

class Allocation : public testing::Test {
 protected:
  void SetUp() override {
    if (!canCountAllocations()) GTEST_SKIP() << "a sanitizer has a malloc of its own";
    // On several threads OpenCV allocates for every parallel loop.
    cv::setNumThreads(1);
  }
  void TearDown() override { cv::setNumThreads(-1); }
};

TEST_F(Allocation, isCounted) {
  startCounting(100);
  auto block = std::make_unique<std::vector<int>>(1000);
  const Allocations allocations = stopCounting();
  EXPECT_EQ(1, allocations.count) << "the vector's elements, not the vector";
  EXPECT_GE(allocations.growth, 4000);

  startCounting();
  block.reset();
  cv::Mat image(100, 100, CV_8UC1);
  EXPECT_GE(stopCounting().count, 1) << "cv::Mat";
}

TEST_F(Allocation, isDoneByTheSegmentationForTheFirstFramesOnly) {
  const std::vector<StreetFrame> frames = streetFrames(5);
  for (const int strips : {1, 3}) {
    for (const auto& [lambda, h] : {std::pair{30, 5}, std::pair{5, 2}, std::pair{80, 15}}) {
      SegmentationParameters parameters;
      parameters.lambda = lambda;
      parameters.h = h;
      Segmentation segmentation(strips);
      cv::Mat labels(frames[0].left.size(), CV_32SC1);
      for (int i = 0; i < 2; ++i) segmentation.compute(frames[i].left, parameters, labels);
      for (const StreetFrame& frame : frames) {
        startCounting();
        segmentation.compute(frame.left, parameters, labels);
        EXPECT_EQ(0, stopCounting().count) << strips << " strips, lambda " << lambda << ", h " << h;
      }
    }
  }
}

TEST_F(Allocation, ofTheSegmentationIsAtMost16BytesAPixel) {
  const std::vector<StreetFrame> frames = streetFrames(5);
  cv::Mat labels(frames[0].left.size(), CV_32SC1);
  Segmentation segmentation;
  startCounting();
  for (const StreetFrame& frame : frames) segmentation.compute(frame.left, {}, labels);
  const double bytes_per_pixel = static_cast<double>(stopCounting().growth) / labels.total();
  RecordProperty("bytes_per_pixel", std::to_string(bytes_per_pixel));
  EXPECT_LE(bytes_per_pixel, 16.0);
  EXPECT_GE(bytes_per_pixel, 8.0) << "gradient, filtered image, codes, exits and ids alone take that much";
}

TEST_F(Allocation, ofTheSegmentationIsAtMost36BytesAPixelForNoiseAndPatterns) {
  cv::Mat noise(500, 800, CV_8UC1), board(500, 800, CV_8UC1), labels(500, 800, CV_32SC1);
  cv::RNG(1).fill(noise, cv::RNG::UNIFORM, 0, 256);
  for (int y = 0; y < board.rows; ++y) {
    for (int x = 0; x < board.cols; ++x) board.at<std::uint8_t>(y, x) = (x + y) % 2 == 0 ? 0 : 1;
  }
  for (const cv::Mat& image : {noise, board}) {
    for (const Connectivity connectivity : {Connectivity::FOUR, Connectivity::EIGHT}) {
      FilteredWatershed watershed;
      startCounting();
      image.copyTo(watershed.image(image.size()));
      watershed.compute(0, 0, connectivity, labels);
      EXPECT_LE(static_cast<double>(stopCounting().growth) / image.total(), 36.0);
    }
  }
}

TEST_F(Allocation, isDoneByTheCensusMatcherForTheFirstFrameOnly) {
  const std::vector<StreetFrame> frames = streetFrames(3);
  for (const int disparity_range : {128, 80}) {
    for (const bool full_width : {true, false}) {
      MatchingParameters parameters;
      parameters.stereo_algorithm = StereoAlgorithm::CENSUS_SGM;
      parameters.disparity_range = disparity_range;
      parameters.full_width = full_width;
      parameters.aggregate_rows = !full_width;
      StereoMatcher matcher(parameters);
      cv::Mat disparity(frames[0].left.size(), CV_32FC1);
      matcher.compute(frames[0].left, frames[0].right, disparity);
      for (const StreetFrame& frame : frames) {
        startCounting();
        matcher.compute(frame.left, frame.right, disparity);
        EXPECT_EQ(0, stopCounting().count) << disparity_range << ", full_width " << full_width;
      }
    }
  }
}

TEST_F(Allocation, isDoneByThePlaneRefinementForTheFirstFramesOnly) {
  const std::vector<StreetFrame> frames = streetFrames(4);
  StereoMatcher matcher;
  Segmentation segmentation;
  std::vector<cv::Mat> disparities(frames.size()), labels(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    matcher.compute(frames[i].left, frames[i].right, disparities[i]);
    segmentation.compute(frames[i].left, {}, labels[i]);
  }
  PlaneRefinement refinement;
  cv::Mat refined(labels[0].size(), CV_32FC1);
  const auto refine = [&](std::size_t i) {
    refinement.refine(disparities[i], labels[i], matcher.range(), 389.0, {}, refined);
  };
  refine(0);
  refine(1);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    startCounting();
    refine(i);
    EXPECT_EQ(0, stopCounting().count) << "frame " << i;
  }
}

TEST_F(Allocation, isDoneByTheQualityRefinementForTheFirstFramesOnly) {
  const std::vector<StreetFrame> frames = streetFrames(4);
  StereoMatcher matcher;
  Segmentation segmentation;
  std::vector<cv::Mat> disparities(frames.size()), labels(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    matcher.compute(frames[i].left, frames[i].right, disparities[i]);
    segmentation.compute(frames[i].left, {}, labels[i]);
  }
  SegmentationParameters coarse;
  coarse.lambda = 80;
  coarse.h = 15;
  using Further = std::vector<SegmentationParameters>;
  for (const auto& [label_pixels, further] :
       {std::pair(true, Further{}), std::pair(false, Further{}), std::pair(true, Further{coarse})}) {
    QualityParameters parameters;
    parameters.label_pixels = label_pixels;
    parameters.further = further;
    QualityRefinement refinement;
    cv::Mat refined(labels[0].size(), CV_32FC1);
    const auto refine = [&](std::size_t i) {
      refinement.refine(disparities[i], labels[i], frames[i].left, matcher.range(), {}, parameters, refined);
    };
    startCounting();
    refine(0);
    refine(1);
    const double bytes_per_pixel = static_cast<double>(stopCounting().growth) / refined.total();
    RecordProperty(!label_pixels     ? "bytes_per_pixel_without_labels"
                   : further.empty() ? "bytes_per_pixel"
                                     : "bytes_per_pixel_with_another_segmentation",
                   std::to_string(bytes_per_pixel));
    EXPECT_LE(bytes_per_pixel, !label_pixels ? 50.0 : further.empty() ? 100.0 : 160.0);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      startCounting();
      refine(i);
      EXPECT_EQ(0, stopCounting().count)
          << "frame " << i << ", label_pixels " << label_pixels << ", further " << further.size();
    }
  }
}

}  // namespace
}  // namespace disparity_refinement
