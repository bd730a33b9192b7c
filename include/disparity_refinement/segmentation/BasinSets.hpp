#pragma once

#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "disparity_refinement/buffers.hpp"

namespace disparity_refinement {

/// Disjoint sets of basins, each named after a basin in it. The name of a basin's set is one look-up away; to
/// join two sets, the basins of one are renamed.
class BasinSets {
 public:
  /// Every basin becomes a set of its own.
  void reset(std::size_t basins) {
    growTo(names_, basins);
    growTo(next_, basins);
    std::iota(names_.begin(), names_.begin() + basins, 0);
    std::iota(next_.begin(), next_.begin() + basins, 0);
  }

  /// The name of every basin's set.
  const std::int32_t* names() const { return names_.data(); }

  /// Gives the basins of a set another name and calls visit(basin) for each.
  template <typename Visitor>
  void rename(std::int32_t set, std::int32_t name, const Visitor& visit) {
    std::int32_t basin = set;
    do {
      names_[basin] = name;
      visit(basin);
      basin = next_[basin];
    } while (basin != set);
  }

  /// The basins of `set` get into the set `into`.
  void join(std::int32_t into, std::int32_t set) {
    rename(set, into, [](std::int32_t) {});
    std::swap(next_[into], next_[set]);  // Two rings become one.
  }

 private:
  std::vector<std::int32_t> names_;
  std::vector<std::int32_t> next_;  // The basins of a set make a ring.
};

}  // namespace disparity_refinement
