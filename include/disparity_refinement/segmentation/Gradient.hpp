#pragma once

#include <opencv2/core.hpp>

namespace disparity_refinement {

/// 3x3 structuring element of the morphological gradient.
enum class StructuringElement { CROSS = 0, SQUARE = 1 };

/// Morphological gradient with shadow enhancement (Lima et al., section III-A).
struct GradientParameters {
  StructuringElement structuring_element = StructuringElement::SQUARE;
  /// Stretch weak gradients in dark regions.
  bool shadow_enhancement = true;
  /// A pixel is in the shadow if its gray value is at most this, 0...255 [gray levels].
  int shadow_threshold = 50;
  /// Exponent of the stretch, 0 < shadow_gamma <= 1. Smaller: stronger.
  double shadow_gamma = 0.45;
};

/// Throws std::invalid_argument that names the parameter, its value and what is expected.
void validate(const GradientParameters& parameters);

/// g(p) = max - min of the gray values under the structuring element; pixels outside the image are ignored.
/// In the shadow g becomes round(255^(1 - gamma) * g^gamma).
class Gradient {
 public:
  /// @param gray      CV_8UC1, not empty.
  /// @param gradient  CV_8UC1 of the same size.
  void compute(const cv::Mat& gray, const GradientParameters& parameters, cv::Mat& gradient);

 private:
  cv::Mat dilated_, eroded_;
};

}  // namespace disparity_refinement
