#include "disparity_refinement/segmentation/CellGrid.hpp"

#include <limits>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {

CellGrid::CellGrid(const cv::Size& size) : rows_(size.height), cols_(size.width) {
  const std::int64_t cells = (std::int64_t{rows_} + 3) * (std::int64_t{cols_} + 1) + 3 * BLOCK;
  requireArgument(cells <= std::numeric_limits<std::int32_t>::max(), "image size with its frame", cells,
                  "less than 2^31 px");
  blocks_ = (rows_ * stride() + BLOCK - 1) / BLOCK;
}

std::array<int, 8> CellGrid::neighbours() const {
  const int s = stride();
  return {-1, 1, -s, s, -s - 1, -s + 1, s - 1, s + 1};
}

cv::Range CellGrid::strip(int i, int n) const {
  const cv::Range blocks = stripOf(blocks_, i, n);
  return {begin() + blocks.start * BLOCK, begin() + blocks.end * BLOCK};
}

}  // namespace disparity_refinement
