#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>

#include "disparity_refinement/segmentation/Connectivity.hpp"

namespace disparity_refinement {
namespace straightforward {

/// A gray image in 16-bit cells, inside a frame one cell wide: every pixel has all its neighbours, so that no
/// bounds need be checked. The frame is higher than any gray value, 255 too: it is neither lower than a pixel
/// nor a part of its plateau.
class PaddedImage {
 public:
  static constexpr std::uint16_t FRAME = 256;

  /// Throws std::invalid_argument if the image is empty, not CV_8UC1, or too large for 32-bit indices.
  void assign(const cv::Mat& image);

  int rows() const { return cells_.rows - 2; }
  int cols() const { return cells_.cols - 2; }

  /// All cells, those of the frame included; row after row without a gap.
  std::uint16_t* cells() { return cells_.ptr<std::uint16_t>(); }
  int size() const { return cells_.rows * cells_.cols; }

  /// Index of the first pixel of a row; cell 0 belongs to the frame.
  int rowBegin(int row) const { return (row + 1) * cells_.cols + 1; }

  /// What leads from the index of a pixel to those of its W, E, N, S, NW, NE, SW, SE neighbours. The first
  /// four are the neighbours of Connectivity::FOUR.
  std::array<int, 8> neighbours() const;

 private:
  cv::Mat cells_;
};

}  // namespace straightforward
}  // namespace disparity_refinement
