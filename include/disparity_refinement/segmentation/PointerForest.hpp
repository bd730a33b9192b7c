#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "disparity_refinement/segmentation/CellGrid.hpp"

namespace disparity_refinement {

/// Finds where the paths end if every cell points to a neighbour or to none, and the paths have no cycles.
///
/// In raster order a cell that points back takes the id of the cell that it points to. A cell that points
/// forward makes a node, an id of its own, and so does one that points nowhere. Nodes are few, and the paths
/// are followed from node to node only: the time is linear however long they are.
///
/// Buffers are kept; one object serves one thread at a time.
class PointerForest {
 public:
  /// Where a cell points, by its code.
  struct Pointers {
    /// From the cell to the one that it points to; 0: to none.
    std::array<std::int32_t, 256> offset;
    /// (code & node_mask) == node_value where offset > 0, and for those of offset 0 whose cells make nodes.
    /// The others of offset 0 are cells that have an id already.
    std::uint8_t node_mask, node_value;
  };

  /// Gives every cell of the grid an id.
  /// @param codes       Of all cells; that of cell 0 has offset 0.
  /// @param first_node  Ids below it are those that cells have already.
  /// @param ids         Of all cells.
  void number(const CellGrid& grid, const std::uint8_t* codes, const Pointers& pointers, int first_node,
              int strips, std::int32_t* ids);

  /// Follows the paths; ids must not have changed since number(). value_of_root(cell) is asked for the value,
  /// >= 0, of each node that points nowhere, in raster order. Ids below first_node are values themselves.
  template <typename ValueOfRoot>
  void resolve(const ValueOfRoot& value_of_root);

  /// After resolve(): the value at the end of the path of every id.
  const std::vector<std::int32_t>& values() const { return values_; }

  /// Number of ids.
  int size() const { return size_; }
  /// From number() to resolve(): the cell of a node, first_node <= id < size(); in raster order. Where strips
  /// meet it may be 0.
  std::int32_t cellOf(int id) const { return values_[id]; }

 private:
  bool makesNode(std::uint8_t code) const { return (code & pointers_.node_mask) == pointers_.node_value; }
  /// The cells at the begin of a strip that may point back to another strip.
  cv::Range border(cv::Range strip) const;
  bool leaves(cv::Range strip, int cell) const;
  int countNodes(cv::Range strip) const;
  void numberStrip(cv::Range strip, int next, std::int32_t* ids);

  CellGrid grid_;
  const std::uint8_t* codes_ = nullptr;
  const std::int32_t* ids_ = nullptr;
  Pointers pointers_{};
  std::array<std::int32_t, 256> back_{};  // The offsets that are negative, else 0.
  std::vector<int> strip_begin_;          // The first id of every strip.
  std::vector<std::int32_t> values_;
  int first_node_ = 0, size_ = 0;
};

template <typename ValueOfRoot>
void PointerForest::resolve(const ValueOfRoot& value_of_root) {
  // Values are kept as ~value until all are known: what is not negative is the id of another node.
  std::int32_t* values = values_.data();
  const int first = first_node_, size = size_;
  for (int id = 0; id < first; ++id) values[id] = ~id;
  for (int id = first; id < size; ++id) {
    const std::int32_t cell = values[id];
    const std::int32_t offset = pointers_.offset[codes_[cell]];
    values[id] = offset != 0 ? ids_[cell + offset] : ~value_of_root(cell);
  }
  for (int id = size - 1; id >= first; --id) {
    std::int32_t end = values[id];
    while (end >= 0) end = values[end];
    // All nodes on the path are done at once: no path is followed twice.
    for (int node = id; values[node] >= 0;) node = std::exchange(values[node], end);
  }
  for (int id = 0; id < size; ++id) values[id] = ~values[id];
}

}  // namespace disparity_refinement
