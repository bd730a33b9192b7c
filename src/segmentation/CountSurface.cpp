#include "disparity_refinement/segmentation/CountSurface.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/buffers.hpp"

namespace disparity_refinement {

void validateSurface(int max_lambda, int max_h) {
  requireArgument(max_lambda >= 0 && max_lambda <= CountSurface::MAX_LAMBDA, "max_lambda", max_lambda,
                  "0...1000");
  requireArgument(max_h >= 0 && max_h <= 255, "max_h", max_h, "0...255");
}

cv::Mat CountSurface::compute(const Basins& basins, const CellBuffers& buffers, int max_lambda, int max_h) {
  validateSurface(max_lambda, max_h);
  // Only the whole image reaches an area of all its pixels or more.
  largest_area_ = std::min(std::max(max_lambda, 1), basins.pixelCount());

  const std::size_t size = basins.size();
  sets_.reset(size);
  growTo(areas_, size);
  growTo(levels_, size * largest_area_);
  std::fill_n(areas_.begin(), size, 0);
  growTo(depths_, largest_area_);
  for (int a = 0; a < largest_area_; ++a) depths_[a].fill(0);
  basins.visitPixels(buffers, [&](const auto* of_pixel) { merge(basins, of_pixel); });

  cv::Mat counts(max_lambda + 1, max_h + 1, CV_32SC1);
  for (int lambda = 0; lambda <= max_lambda; ++lambda) {
    const auto& minima = depths_[std::min(std::max(lambda, 1), largest_area_) - 1];
    int deeper = std::accumulate(minima.begin(), minima.end(), 0);
    for (int h = 0; h <= max_h; ++h) {
      deeper -= minima[h];
      counts.at<int>(lambda, h) = 1 + deeper;
    }
  }
  return counts;
}

template <typename Index>
void CountSurface::merge(const Basins& basins, const Index* pixels) {
  const std::int32_t* set_of = sets_.names();
  for (int level = 0; level < Basins::SUMMIT_LEVEL; ++level) {
    const cv::Range own_pixels = basins.pixelsOf(level);
    for (int i = own_pixels.start; i < own_pixels.end; ++i) {
      const std::int32_t set = set_of[pixels[i]];
      const std::int32_t area = ++areas_[set];
      if (area <= largest_area_) levelsOf(set)[area - 1] = static_cast<std::uint8_t>(level);
    }
    const cv::Range saddles = basins.saddlesOf(level);
    for (int i = saddles.start; i < saddles.end; ++i) {
      const std::int32_t a = set_of[basins.saddles()[i].a], b = set_of[basins.saddles()[i].b];
      if (a != b) unite(a, b, level);
    }
  }
  // At the summit everything meets.
  for (int basin = 0; basin < basins.size(); ++basin) {
    const std::int32_t all = set_of[Basins::SUMMIT], set = set_of[basin];
    if (set != all) unite(all, set, Basins::SUMMIT_LEVEL);
  }
}

void CountSurface::unite(std::int32_t a, std::int32_t b, int level) {
  if (areas_[a] < areas_[b]) std::swap(a, b);
  sets_.join(a, b);
  std::uint8_t* levels = levelsOf(a);
  const std::uint8_t* others = levelsOf(b);
  const std::int32_t known = std::min(areas_[a], largest_area_),
                     known_of_b = std::min(areas_[b], largest_area_);
  const std::int32_t common = std::min(known, known_of_b);
  for (std::int32_t i = 0; i < common; ++i) {
    const auto [first, last] = std::minmax(levels[i], others[i]);
    ++depths_[i][level - last];
    levels[i] = first;
  }
  for (std::int32_t i = known; i < known_of_b; ++i) levels[i] = others[i];
  areas_[a] += areas_[b];
  const std::int32_t reached = std::min(areas_[a], largest_area_);
  for (std::int32_t i = std::max(known, known_of_b); i < reached; ++i) {
    levels[i] = static_cast<std::uint8_t>(level);
  }
}

}  // namespace disparity_refinement
