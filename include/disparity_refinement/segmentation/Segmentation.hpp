#pragma once

#include <opencv2/core.hpp>

#include "disparity_refinement/segmentation/Connectivity.hpp"
#include "disparity_refinement/segmentation/FilteredWatershed.hpp"
#include "disparity_refinement/segmentation/Gradient.hpp"

namespace disparity_refinement {

/// Parameters of the segmentation (Lima et al., section III-A).
struct SegmentationParameters {
  /// Smallest area of a segment's core [px], >= 0. Larger: fewer segments.
  int lambda = 30;
  /// Smallest depth of a segment's minimum [gray levels of the gradient], 0...255. Larger: fewer segments.
  int h = 5;
  Connectivity connectivity = Connectivity::EIGHT;
  GradientParameters gradient;
};

/// Throws std::invalid_argument that names the parameter, its value and what is expected.
void validate(const SegmentationParameters& parameters);

/// Segments a gray image: gradient, shadow enhancement, area closing, H-minima, LC-WT, in this order.
///
/// The time is linear in the number of pixels and hardly depends on lambda and h. Buffers are kept between
/// frames; one object serves one thread at a time.
class Segmentation {
 public:
  /// @param strips  See FilteredWatershed.
  explicit Segmentation(int strips = 1);

  /// @param gray    CV_8UC1, not empty; throws std::invalid_argument otherwise.
  /// @param labels  CV_32SC1 of the same size, 0 ... n - 1, numbered in raster order of the first pixels of
  ///                their minima; written in place if it has that type and size already.
  /// @return        n, the number of segments.
  int compute(const cv::Mat& gray, const SegmentationParameters& parameters, cv::Mat& labels);

  /// The numbers of segments for lambda = 0 ... max_lambda (rows) and h = 0 ... max_h (columns), CV_32SC1;
  /// lambda and h of the parameters do not matter. Throws as compute() and CountSurface do.
  cv::Mat countSurface(const cv::Mat& gray, const SegmentationParameters& parameters, int max_lambda,
                       int max_h);

  /// Intermediate results of the last compute(), CV_8UC1, valid until the next call.
  cv::Mat gradient() const { return watershed_.image(); }
  cv::Mat filtered() const { return watershed_.filtered(); }

 private:
  void computeGradient(const cv::Mat& gray, const SegmentationParameters& parameters);

  int strips_;
  Gradient gradient_;
  FilteredWatershed watershed_;
};

}  // namespace disparity_refinement
