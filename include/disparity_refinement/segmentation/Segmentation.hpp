#pragma once

#include <opencv2/core.hpp>

#include "disparity_refinement/segmentation/Connectivity.hpp"
#include "disparity_refinement/segmentation/Gradient.hpp"
#include "disparity_refinement/segmentation/MinTree.hpp"
#include "disparity_refinement/segmentation/Watershed.hpp"

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
/// Buffers are kept between frames; one object serves one thread at a time.
class Segmentation {
 public:
  /// @param gray    CV_8UC1, not empty; throws std::invalid_argument otherwise.
  /// @param labels  CV_32SC1 of the same size, 0 ... n - 1; written in place if it has that type and size
  /// already.
  /// @return        n, the number of segments.
  int compute(const cv::Mat& gray, const SegmentationParameters& parameters, cv::Mat& labels);

  /// Intermediate results of the last compute(), valid until the next one.
  const cv::Mat& gradient() const { return gradient_image_; }
  const cv::Mat& filtered() const { return filtered_; }
  const MinTree& tree() const { return tree_; }

 private:
  Gradient gradient_;
  MinTree tree_;
  Watershed watershed_;
  cv::Mat gradient_image_, filtered_;
};

}  // namespace disparity_refinement
