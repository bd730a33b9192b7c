#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/SegmentRuns.hpp"

namespace disparity_refinement {

/// The points of one segment at a time: its pixels that have a disparity, in raster order.
///
/// Point i, 0 <= i < size, is the pixel (origin_x + x[i], origin_y + y[i]) [px] of disparity d[i] [px]. The
/// origin is in the middle of the segment's bounding box: coordinates are small. The last point is followed
/// by PADDING points whose d is NaN. The buffers only grow.
struct SegmentPoints {
  static constexpr int PADDING = 3;  ///< Fills the last vector of four points.

  /// @param disparity  CV_32FC1 [px].
  /// @param runs       Inside the image; at least one.
  void gather(const cv::Mat& disparity, const DisparityRange& range, RunSpan runs);

  int pixels = 0;  ///< Of the segment.
  int size = 0;
  int origin_x = 0, origin_y = 0;
  std::vector<int> x, y;
  std::vector<float> d;
};

}  // namespace disparity_refinement
