#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "disparity_refinement/segmentation/BasinSets.hpp"
#include "disparity_refinement/segmentation/Basins.hpp"

namespace disparity_refinement {

/// Throws std::invalid_argument unless lambda >= 0 and 0 <= h <= 255.
void validateFilter(int lambda, int h);

/// Area closing and H-minima, in this order, on the basins of an image f:
///
///   area closing  a(p)   = min { t : |CC_t(p)| >= lambda }, CC_t(p) the component of {f <= t} that holds p
///   H-minima      out(p) = reconstruction by erosion of a + h over a
///
/// Both are one test. Call a component of {f <= t} live if some component inside it reached the area lambda
/// at a level t0 <= t - h, where a component that is the whole image counts as having reached it. Then
///
///   out(p) = min { t >= f(p) : CC_t(p) is live }, at most 255.
///
/// For a component that becomes live at the level t without a live one inside, out = t on all its pixels and
/// more around it: a regional minimum of `out`. There are no others. Since a component that contains a live
/// one is live, out(p) = max(f(p), T), where T depends on the basin of p only.
///
/// The basins are merged along their saddles from level 0 upwards. Until they are live, the basins of a
/// component are a set, of which the smaller is renamed when two meet: a basin at most log2(pixels) times;
/// live ones need no sets any more.
///
/// Buffers are kept between images; one object serves one thread at a time.
class BasinFilter {
 public:
  static constexpr std::int32_t NONE = -1;

  /// Of a basin.
  struct Result {
    std::int32_t minimum;  ///< The minimum whose pixels are those of the basin with f <= level, or NONE.
    std::int32_t level;    ///< T
  };

  /// @param lambda  Smallest area of a component that stays [px], >= 0; 0 and 1 close nothing.
  /// @param h       Smallest depth of a minimum that stays [gray levels], 0...255; 0 fills nothing.
  /// @return        Number of regional minima, numbered from 0 in raster order of their first pixels.
  /// @throws std::invalid_argument  for lambda or h out of range.
  int run(const Basins& basins, const CellBuffers& buffers, int lambda, int h);

  /// Of every basin after run(), by its number; there may be more behind.
  const std::vector<Result>& results() const { return results_; }

 private:
  static constexpr std::int32_t LIVE = Basins::SUMMIT;  // The name of the live basins' set; SUMMIT is alone.
  static constexpr std::int16_t NEVER = 1 << 12;
  static constexpr std::int32_t NO_CANDIDATE = -1;

  template <typename Index>
  int merge(const Basins& basins, const Index* pixels);
  void meet(std::int32_t a, std::int32_t b, int level);
  void unite(std::int32_t larger, std::int32_t smaller, int level);
  void reachLambda(std::int32_t set, int level);
  void enliven(std::int32_t set, Result result);
  void numberMinima(const Basins& basins, const CellBuffers& buffers, int count);

  int lambda_ = 0, h_ = 0;
  BasinSets sets_;
  std::vector<std::int32_t> areas_;    // Pixels so far [px], by the name of the set.
  std::vector<std::int16_t> reached_;  // The level t0, or NEVER, by the name of the set.
  std::vector<Result> results_;
  // The sets that will be live at a level, unless they meet a live one before: a list for every level. A set
  // may have got another name since.
  std::array<std::int32_t, Basins::LEVELS> first_candidate_{};
  std::vector<std::int32_t> next_candidate_;
};

}  // namespace disparity_refinement
