#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/segmentation/BasinSets.hpp"
#include "disparity_refinement/segmentation/Basins.hpp"

namespace disparity_refinement {

/// Throws std::invalid_argument unless 0 <= max_lambda <= CountSurface::MAX_LAMBDA and 0 <= max_h <= 255.
void validateSurface(int max_lambda, int max_h);

/// Counts the regional minima that area closing and H-minima leave of an image f, for all lambda and h at
/// once (Lima et al., Figure 5), without filtering the image.
///
/// For an area a >= 1, let t_a be the level at which a component of {f <= t} first had a pixels inside it.
/// When two components meet at a level t, the one of the larger t_a ends as a minimum of depth t - t_a; one
/// minimum stays for ever. Closing by lambda = a and filling by h leaves
///
///   N(lambda, h) = 1 + number of those with t - t_a > h,   N(0, h) = N(1, h).
///
/// Takes as many bytes as basins times max_lambda. Buffers are kept between images.
class CountSurface {
 public:
  static constexpr int MAX_LAMBDA = 1000;

  /// @param max_lambda  Largest lambda [px], 0...MAX_LAMBDA.
  /// @param max_h       Largest h [gray levels], 0...255.
  /// @return            N, CV_32SC1: rows lambda = 0 ... max_lambda, columns h = 0 ... max_h.
  /// @throws std::invalid_argument  for max_lambda or max_h out of range.
  cv::Mat compute(const Basins& basins, const CellBuffers& buffers, int max_lambda, int max_h);

 private:
  template <typename Index>
  void merge(const Basins& basins, const Index* pixels);
  void unite(std::int32_t a, std::int32_t b, int level);
  /// The levels t_a of a set of basins, for a = 1 ... largest_area_ from index 0 on; known up to its area.
  std::uint8_t* levelsOf(std::int32_t set) {
    return levels_.data() + static_cast<std::size_t>(set) * largest_area_;
  }

  std::int32_t largest_area_ = 0;
  BasinSets sets_;
  std::vector<std::int32_t> areas_;  // Pixels so far [px], by the name of the set.
  std::vector<std::uint8_t> levels_;
  std::vector<std::array<std::int32_t, Basins::LEVELS>> depths_;  // By area - 1: minima of every depth.
};

}  // namespace disparity_refinement
