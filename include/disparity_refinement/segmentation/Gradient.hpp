#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

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
///
/// Buffers are kept between images; one object serves one thread at a time.
class Gradient {
 public:
  /// @param gray      CV_8UC1, not empty.
  /// @param gradient  CV_8UC1 of the same size; written in place if it has that type and size already.
  /// @param strips    The rows are worked on in this number of strips, >= 1, side by side if OpenCV has the
  ///                  threads.
  void compute(const cv::Mat& gray, const GradientParameters& parameters, cv::Mat& gradient, int strips = 1);

 private:
  using Table = std::array<std::uint8_t, 256>;
  /// A row of pixels with a margin on both sides.
  using Line = std::vector<std::uint8_t>;
  struct Lines {
    Line own, highest, lowest;
  };

  void computeRows(const cv::Mat& gray, const GradientParameters& parameters, cv::Range rows, Lines& lines,
                   cv::Mat& gradient) const;

  std::vector<Lines> lines_;  // Of every strip.
  Table shadow_table_{};
  double shadow_table_gamma_ = 0.0;
};

}  // namespace disparity_refinement
