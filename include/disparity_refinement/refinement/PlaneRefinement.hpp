#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/PlaneFitting.hpp"
#include "disparity_refinement/refinement/PlaneRefinementParameters.hpp"

namespace disparity_refinement {

/// Smallest value of a plane that may be written: range.min, or the bound of condition 1 if that is larger.
float smallestPlaneDisparity(const DisparityRange& range, double focal_length_times_baseline,
                             const PlaneRefinementParameters& parameters);

/// Fits a plane to the disparities of every segment and writes it back where the four conditions of the paper
/// hold.
///
/// The random numbers of a segment depend on its label alone: the result is the same for any number of
/// threads. Buffers are kept between frames; one object serves one thread at a time.
class PlaneRefinement {
 public:
  /// @param disparity  CV_32FC1 [px]; valid where finite and range.isValid.
  /// @param labels     CV_32SC1 of the same size, 0 ... n - 1; some may be missing. A pixel with a negative
  ///                   label is in no segment and keeps its disparity.
  /// @param range      Range of the disparities. Measured disparities above range.max are valid and stay.
  /// @param focal_length_times_baseline  f * T [px * m], > 0, for condition 1.
  /// @param refined    CV_32FC1 of the same size; written in place if it has that type and size already.
  ///                   Invalid pixels hold range.invalid(), and at least one pixel does.
  /// @throws std::invalid_argument  for images of another type, empty, or of different size, a label of at
  ///                   least the number of pixels, a `refined` that shares memory with an input, and bad
  ///                   parameters; `refined` is not touched then.
  void refine(const cv::Mat& disparity, const cv::Mat& labels, const DisparityRange& range,
              double focal_length_times_baseline, const PlaneRefinementParameters& parameters,
              cv::Mat& refined);

  /// Plane of every label of the last refine().
  const std::vector<SegmentPlane>& planes() const { return fitting_.planes(); }

 private:
  PlaneFitting fitting_;
};

}  // namespace disparity_refinement
