#pragma once

#include <array>
#include <vector>

#include "disparity_refinement/refinement/SegmentPoints.hpp"

namespace disparity_refinement {

/// The plane d = a x + b y + c; x, y in pixels of the image, d in px.
struct DisparityPlane {
  double a = 0.0, b = 0.0, c = 0.0;
  bool is_known = false;

  double at(double x, double y) const { return a * x + b * y + c; }
};

/// What was measured in a segment: up to SIZE of its pixels with a disparity, spread evenly over them.
struct SegmentSupport {
  static constexpr int SIZE = 64;

  int valid = 0;  ///< Pixels of the segment with a disparity.
  int size = 0;   ///< Of the sample.
  std::array<float, SIZE> x, y, d;

  /// Pixels that a member of the sample stands for.
  double weight() const { return size > 0 ? static_cast<double>(valid) / size : 0.0; }

  void sample(const SegmentPoints& points) {
    valid = points.size;
    size = valid < SIZE ? valid : SIZE;
    for (int i = 0; i < size; ++i) {
      // The middle of part i of `size` equal parts.
      const auto k = static_cast<std::size_t>((2LL * i + 1) * valid / (2 * size));
      x[i] = static_cast<float>(points.x[k] + points.origin_x);
      y[i] = static_cast<float>(points.y[k] + points.origin_y);
      d[i] = points.d[k];
    }
  }
};

}  // namespace disparity_refinement
