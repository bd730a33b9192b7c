#include "disparity_refinement/segmentation/BasinFilter.hpp"

#include <algorithm>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/buffers.hpp"

namespace disparity_refinement {

void validateFilter(int lambda, int h) {
  requireArgument(lambda >= 0, "lambda", lambda, "at least 0");
  requireArgument(h >= 0 && h <= 255, "h", h, "0...255");
}

int BasinFilter::run(const Basins& basins, const CellBuffers& buffers, int lambda, int h) {
  validateFilter(lambda, h);
  // The whole image reaches any area, and a component has one pixel at least.
  lambda_ = std::min(std::max(lambda, 1), basins.pixelCount());
  h_ = h;

  const std::size_t size = basins.size();
  sets_.reset(size);
  growTo(areas_, size);
  growTo(reached_, size);
  growTo(results_, size);
  std::fill_n(reached_.begin(), size, NEVER);
  std::fill_n(areas_.begin(), size, 0);
  std::fill_n(results_.begin(), size, Result{NONE, Basins::SUMMIT_LEVEL});
  // Live sets go on to count pixels, but have reached lambda long since.
  areas_[LIVE] = lambda_;
  growTo(next_candidate_, size);
  first_candidate_.fill(NO_CANDIDATE);

  const int minima =
      basins.visitPixels(buffers, [&](const auto* of_pixel) { return merge(basins, of_pixel); });
  if (minima > 0) {
    numberMinima(basins, buffers, minima);
    return minima;
  }
  // Only the whole image becomes live, at level 255.
  std::fill_n(results_.begin(), size, Result{0, Basins::SUMMIT_LEVEL});
  return 1;
}

template <typename Index>
int BasinFilter::merge(const Basins& basins, const Index* pixels) {
  // Locals: the compiler need not look whether the areas written are members.
  const std::int32_t* set_of = sets_.names();
  std::int32_t* areas = areas_.data();
  const int lambda = lambda_;
  int minima = 0;
  for (int level = 0; level < Basins::SUMMIT_LEVEL; ++level) {
    const cv::Range own_pixels = basins.pixelsOf(level);
    for (int i = own_pixels.start; i < own_pixels.end; ++i) {
      const std::int32_t set = set_of[pixels[i]];
      if (++areas[set] != lambda) continue;
      reachLambda(set, level);
    }
    const cv::Range saddles = basins.saddlesOf(level);
    for (int i = saddles.start; i < saddles.end; ++i) {
      const Basins::Saddle& saddle = basins.saddles()[i];
      const std::int32_t a = set_of[saddle.a], b = set_of[saddle.b];
      if (a != b) meet(a, b, level);
    }
    for (std::int32_t k = first_candidate_[level]; k != NO_CANDIDATE; k = next_candidate_[k]) {
      const std::int32_t candidate = set_of[k];
      if (candidate != LIVE && reached_[candidate] + h_ == level) enliven(candidate, {minima++, level});
    }
  }
  return minima;
}

void BasinFilter::meet(std::int32_t a, std::int32_t b, int level) {
  if (a == LIVE) {
    enliven(b, {NONE, level});
  } else if (b == LIVE) {
    enliven(a, {NONE, level});
  } else if (areas_[a] < areas_[b]) {
    unite(b, a, level);
  } else {
    unite(a, b, level);
  }
}

void BasinFilter::unite(std::int32_t larger, std::int32_t smaller, int level) {
  sets_.join(larger, smaller);
  areas_[larger] += areas_[smaller];
  if (reached_[smaller] < reached_[larger]) {
    // The smaller one is a candidate already, and is called `larger` from here on.
    reached_[larger] = reached_[smaller];
  } else if (reached_[larger] == NEVER && areas_[larger] >= lambda_) {
    reachLambda(larger, level);
  }
}

// No set of the same name does so a second time, so that one link for each is enough.
void BasinFilter::reachLambda(std::int32_t set, int level) {
  reached_[set] = static_cast<std::int16_t>(level);
  const int live_level = level + h_;
  if (live_level >= Basins::SUMMIT_LEVEL) return;
  next_candidate_[set] = first_candidate_[live_level];
  first_candidate_[live_level] = set;
}

void BasinFilter::enliven(std::int32_t set, Result result) {
  sets_.rename(set, LIVE, [&](std::int32_t basin) { results_[basin] = result; });
}

// The first pixel of a minimum in raster order has no earlier neighbour that is as low: it is a start.
void BasinFilter::numberMinima(const Basins& basins, const CellBuffers& buffers, int count) {
  std::int32_t* numbers = areas_.data();  // The areas are not needed any more.
  std::fill_n(numbers, count, NONE);
  int next = 0;
  for (int i = 0; i < basins.startCount() && next < count; ++i) {
    const std::int32_t cell = basins.starts()[i];
    const Result& result = results_[buffers.ids[cell]];
    if (result.minimum == NONE || numbers[result.minimum] != NONE) continue;
    if (basins.image()[cell] <= result.level) numbers[result.minimum] = next++;
  }
  for (int basin = 0; basin < basins.size(); ++basin) {
    std::int32_t& minimum = results_[basin].minimum;
    if (minimum != NONE) minimum = numbers[minimum];
  }
}

}  // namespace disparity_refinement
