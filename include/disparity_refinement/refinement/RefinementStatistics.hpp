#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"

namespace disparity_refinement {

/// What a refinement did to one frame.
struct RefinementStatistics {
  double valid_before = 0.0, valid_after = 0.0;  ///< Share of the pixels that have a disparity, 0...1.
  int segments = 0;                              ///< Those that have a pixel.
  /// Of these, refused by condition 1 or for a plane outside the disparity range, and by condition 4: those
  /// with a plane of which more than half the pixels are refused so. 0 in mode QUALITY.
  int refused_by_depth_error = 0, refused_by_divergence = 0;
  /// Of these, without a plane of their own: by condition 2, because none spans a plane, by condition 3.
  int too_few_points = 0, degenerate = 0, max_iterations = 0;
};

/// @param disparity, labels, range, focal_length_times_baseline, parameters, refined
///                   What was given to DisparityRefinement::refine(), and what it made.
/// @param fitted     Its fittedPlanes().
/// @throws std::invalid_argument  for images of another type, empty, or of different size, and a label
///                   without a plane.
RefinementStatistics measureRefinement(const cv::Mat& disparity, const cv::Mat& refined,
                                       const cv::Mat& labels, const DisparityRange& range,
                                       double focal_length_times_baseline,
                                       const RefinementParameters& parameters,
                                       const std::vector<SegmentPlane>& fitted);

}  // namespace disparity_refinement
