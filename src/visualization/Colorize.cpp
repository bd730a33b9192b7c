#include "disparity_refinement/visualization/Colorize.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <string>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

const cv::Vec3b BLACK(0, 0, 0);

// The colours of the map for 0...255, one row.
cv::Mat colourTable(int colour_map) {
  cv::Mat levels(1, 256, CV_8UC1), table;
  std::iota(levels.begin<std::uint8_t>(), levels.end<std::uint8_t>(), std::uint8_t{0});
  cv::applyColorMap(levels, table, colour_map);
  return table;
}

cv::Vec3b labelColour(int label) {
  if (label < 0) return BLACK;
  // Fibonacci hashing: 2^32 divided by the golden ratio sets consecutive labels far apart. No channel is
  // below 64, so that no label looks black.
  const std::uint32_t hash = (static_cast<std::uint32_t>(label) + 1U) * 2654435769U;
  const auto channel = [hash](int shift) {
    return static_cast<std::uint8_t>(64 + (hash >> shift & 255) * 3 / 4);
  };
  return {channel(24), channel(16), channel(8)};
}

cv::Vec3b errorColour(float error) {
  if (error <= 1.0F) return {0, 160, 0};
  if (error <= 2.0F) return {0, 255, 255};
  if (error <= 3.0F) return {0, 140, 255};
  return {0, 0, 255};
}

}  // namespace

void colorizeDisparity(const cv::Mat& disparity, const DisparityRange& range, float scale_min,
                       float scale_max, cv::Mat& bgr) {
  requireImage(disparity, "disparity", CV_32FC1);
  requireArgument(std::isfinite(scale_min), "scale_min", scale_min, "a finite number");
  requireArgument(std::isfinite(scale_max - scale_min) && scale_max > scale_min, "scale_max", scale_max,
                  "greater than scale_min, " + std::to_string(scale_min) + ", by a finite difference");
  const cv::Mat table = colourTable(cv::COLORMAP_TURBO);
  const cv::Vec3b* colours = table.ptr<cv::Vec3b>();
  bgr.create(disparity.size(), CV_8UC3);
  for (int y = 0; y < disparity.rows; ++y) {
    const float* row = disparity.ptr<float>(y);
    cv::Vec3b* out = bgr.ptr<cv::Vec3b>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      const float share = (std::clamp(row[x], scale_min, scale_max) - scale_min) / (scale_max - scale_min);
      out[x] = range.isValid(row[x]) ? colours[cvRound(share * 255.0F)] : BLACK;
    }
  }
}

void colorizeLabels(const cv::Mat& labels, cv::Mat& bgr) {
  requireImage(labels, "labels", CV_32SC1);
  bgr.create(labels.size(), CV_8UC3);
  for (int y = 0; y < labels.rows; ++y) {
    const int* row = labels.ptr<int>(y);
    std::transform(row, row + labels.cols, bgr.ptr<cv::Vec3b>(y), labelColour);
  }
}

void drawSegmentBorders(const cv::Mat& image, const cv::Mat& labels, cv::Mat& bgr, const cv::Vec3b& colour) {
  requireImage(image, "image", image.channels() == 3 ? CV_8UC3 : CV_8UC1);
  requireImage(labels, "labels", CV_32SC1, image.size());
  if (image.channels() == 3) {
    image.copyTo(bgr);
  } else {
    cv::cvtColor(image, bgr, cv::COLOR_GRAY2BGR);
  }
  for (int y = 0; y < labels.rows; ++y) {
    const int* row = labels.ptr<int>(y);
    const int* below = labels.ptr<int>(std::min(y + 1, labels.rows - 1));
    cv::Vec3b* out = bgr.ptr<cv::Vec3b>(y);
    for (int x = 0; x < labels.cols; ++x) {
      const int right = row[std::min(x + 1, labels.cols - 1)];
      if (row[x] != right || row[x] != below[x]) out[x] = colour;
    }
  }
}

cv::Vec3b refusalColour(PlaneStatus status) {
  switch (status) {
    case PlaneStatus::ACCEPTED:
      return BLACK;
    case PlaneStatus::TOO_FEW_POINTS:
      return {0, 150, 255};
    case PlaneStatus::DEGENERATE:
      return {230, 0, 230};
    case PlaneStatus::MAX_ITERATIONS:
      return {0, 0, 255};
    case PlaneStatus::OF_NEIGHBOUR:
      return {255, 120, 0};
  }
  return BLACK;
}

void drawRefusedSegments(const cv::Mat& gray, const cv::Mat& labels, const std::vector<SegmentPlane>& planes,
                         cv::Mat& bgr) {
  requireImage(gray, "gray", CV_8UC1);
  requireLabels(labels, gray.size(), planes.size());
  cv::cvtColor(gray, bgr, cv::COLOR_GRAY2BGR);
  for (int y = 0; y < labels.rows; ++y) {
    const int* row = labels.ptr<int>(y);
    cv::Vec3b* out = bgr.ptr<cv::Vec3b>(y);
    for (int x = 0; x < labels.cols; ++x) {
      if (row[x] < 0) continue;
      const PlaneStatus status = planes[static_cast<std::size_t>(row[x])].status;
      if (status != PlaneStatus::ACCEPTED) out[x] = out[x] / 2 + refusalColour(status) / 2;
    }
  }
  drawSegmentBorders(bgr, labels, bgr, {200, 200, 200});
}

void colorizeError(const cv::Mat& disparity, const DisparityRange& range, const cv::Mat& ground_truth,
                   cv::Mat& bgr) {
  requireImage(disparity, "disparity", CV_32FC1);
  requireImage(ground_truth, "ground_truth", CV_32FC1, disparity.size());
  const cv::Vec3b grey(128, 128, 128);
  bgr.create(disparity.size(), CV_8UC3);
  for (int y = 0; y < disparity.rows; ++y) {
    const float* measured = disparity.ptr<float>(y);
    const float* truth = ground_truth.ptr<float>(y);
    cv::Vec3b* out = bgr.ptr<cv::Vec3b>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      if (!(truth[x] > 0.0F)) {
        out[x] = BLACK;
      } else if (!range.isValid(measured[x])) {
        out[x] = grey;
      } else {
        out[x] = errorColour(std::abs(measured[x] - truth[x]));
      }
    }
  }
}

}  // namespace disparity_refinement
