#include "disparity_refinement/segmentation/PointerForest.hpp"

#include <algorithm>
#include <opencv2/core/hal/intrin.hpp>

#include "disparity_refinement/buffers.hpp"
#include "disparity_refinement/segmentation/branchless.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {

void PointerForest::number(const CellGrid& grid, const std::uint8_t* codes, const Pointers& pointers,
                           int first_node, int strips, std::int32_t* ids) {
  grid_ = grid;
  codes_ = codes;
  ids_ = ids;
  pointers_ = pointers;
  first_node_ = first_node;
  for (int code = 0; code < 256; ++code) back_[code] = std::min(pointers.offset[code], 0);

  strip_begin_.resize(strips + 1);
  strip_begin_[0] = first_node;
  forEachStrip(strips, [&](int i) { strip_begin_[i + 1] = countNodes(grid.strip(i, strips)); });
  // One more id for each strip: see numberStrip().
  for (int i = 0; i < strips; ++i) strip_begin_[i + 1] += strip_begin_[i] + 1;
  size_ = strip_begin_[strips];
  // Half the cells are enough for what cameras see: the numbers of nodes differ much.
  growTo(values_, size_, grid.capacity() / 2);
  forEachStrip(strips, [&](int i) { numberStrip(grid.strip(i, strips), strip_begin_[i], ids); });
}

cv::Range PointerForest::border(cv::Range strip) const {
  const int size = strip.start == grid_.begin() ? 0 : grid_.stride() + 1;
  return {strip.start, std::min(strip.start + size, strip.end)};
}

bool PointerForest::leaves(cv::Range strip, int cell) const {
  return cell + back_[codes_[cell]] < strip.start;
}

int PointerForest::countNodes(cv::Range strip) const {
  using cv::v_uint8x16;
  const v_uint8x16 mask = cv::v_setall_u8(pointers_.node_mask);
  const v_uint8x16 value = cv::v_setall_u8(pointers_.node_value);
  const v_uint8x16 one = cv::v_setall_u8(1);
  unsigned count = 0;
  for (int p = strip.start; p < strip.end; p += 16) {
    count += cv::v_reduce_sum(((cv::v_load(codes_ + p) & mask) == value) & one);
  }
  const cv::Range cells = border(strip);
  for (int p = cells.start; p < cells.end; ++p) count += leaves(strip, p) ? 1 : 0;
  return static_cast<int>(count);
}

// Branches that depend on the image would cost more than the work. So the cell of the next node is written at
// every cell, and once behind the last node.
void PointerForest::numberStrip(cv::Range strip, int next, std::int32_t* ids) {
  std::int32_t* cell_of = values_.data();
  const cv::Range cells = border(strip);
  for (int p = cells.start; p < cells.end; ++p) {
    const bool is_node = makesNode(codes_[p]) || leaves(strip, p);
    ids[p] = is_node ? next : ids[p + back_[codes_[p]]];
    cell_of[next] = p;
    next += is_node ? 1 : 0;
  }

  const std::uint8_t* codes = codes_;
  const std::int32_t* back = back_.data();
  const unsigned mask = pointers_.node_mask, value = pointers_.node_value;
  const int end = strip.end;
  for (int p = cells.end; p < end; ++p) {
    const unsigned code = codes[p];
    const bool is_node = (code & mask) == value;
    ids[p] = select(is_node, next, ids[p + back[code]]);
    cell_of[next] = p;
    next += static_cast<int>(is_node);
  }
  cell_of[next] = 0;
}

}  // namespace disparity_refinement
