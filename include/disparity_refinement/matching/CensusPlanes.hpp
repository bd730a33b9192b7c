#pragma once

#include <opencv2/core.hpp>

namespace disparity_refinement {

/// What the census matcher compares of a pixel: 16 bits of a centre-symmetric census transform and the
/// horizontal slope of the gray values.
///
/// A census bit is I(p + o) < I(p - o) for one of the 16 offsets o = (dx, dy) of the upper half of a window
/// of 9 x 7 pixels (dy = -3 ... 0, dx = -4 ... 4, dy = 0: dx < 0) for which dx + dy is odd. Images are
/// continued by their border pixels.
struct CensusPlanes {
  static constexpr int WIDTH = 9, HEIGHT = 7;  ///< Of the window [px].
  static constexpr int MAX_SLOPE = 15;

  cv::Mat census[2];  ///< CV_8UC1: eight bits each.
  cv::Mat slope;  ///< CV_8UC1, 0 ... MAX_SLOPE: half of 15 + Sobel's derivative along x, cut to -15 ... 15.

  /// @param gray    CV_8UC1, not empty.
  /// @param strips  Strips of rows that are computed side by side, >= 1; the result does not depend on it.
  void compute(const cv::Mat& gray, int strips = 1);

 private:
  cv::Mat padded_;
};

}  // namespace disparity_refinement
