#include "disparity_refinement/segmentation/BasinFilter.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/segmentation/buffers.hpp"

namespace disparity_refinement {

void validateFilter(int lambda, int h) {
  requireArgument(lambda >= 0, "lambda", lambda, "at least 0");
  requireArgument(h >= 0 && h <= 255, "h", h, "0...255");
}

int BasinFilter::run(const Basins& basins, int pixels, int lambda, int h) {
  validateFilter(lambda, h);
  // The whole image reaches any area, and a component has one pixel at least.
  lambda_ = std::min(std::max(lambda, 1), pixels);
  h_ = h;

  const std::size_t size = basins.size();
  growTo(set_of_, size);
  growTo(next_in_set_, size);
  growTo(sets_, size);
  growTo(areas_, size);
  growTo(results_, size);
  std::iota(set_of_.begin(), set_of_.begin() + size, 0);
  std::iota(next_in_set_.begin(), next_in_set_.begin() + size, 0);
  std::fill_n(sets_.begin(), size, Set{1, NEVER});
  std::fill_n(areas_.begin(), size, 0);
  std::fill_n(results_.begin(), size, Result{NONE, Basins::SUMMIT_LEVEL});
  // Live sets go on to count pixels, but have reached lambda long since.
  areas_[LIVE] = lambda_;
  candidates_of_.fill(-1);
  candidates_.clear();
  growTo(candidates_, 0);

  const int minima = basins.visitPixels([&](const auto* of_pixel) { return merge(basins, of_pixel); });
  if (minima > 0) return minima;
  // Only the whole image becomes live, at level 255.
  std::fill_n(results_.begin(), size, Result{0, Basins::SUMMIT_LEVEL});
  return 1;
}

template <typename Index>
int BasinFilter::merge(const Basins& basins, const Index* pixels) {
  // Locals: the compiler need not look whether the areas written are members.
  const std::int32_t* set_of = set_of_.data();
  std::int32_t* areas = areas_.data();
  const int lambda = lambda_;
  int minima = 0;
  for (int level = 0; level < Basins::SUMMIT_LEVEL; ++level) {
    const cv::Range own_pixels = basins.pixelsOf(level);
    for (int i = own_pixels.start; i < own_pixels.end; ++i) {
      const std::int32_t set = set_of[pixels[i]];
      if (++areas[set] != lambda) continue;
      sets_[set].reached = level;
      reach(set, level);
    }
    const cv::Range saddles = basins.saddlesOf(level);
    for (int i = saddles.start; i < saddles.end; ++i) {
      const Basins::Saddle& saddle = basins.saddles()[i];
      const std::int32_t a = set_of[saddle.a], b = set_of[saddle.b];
      if (a != b) meet(a, b, level);
    }
    // What is still a set of this name, and meant to be live now, has not met a live one.
    for (std::int32_t k = candidates_of_[level]; k >= 0; k = candidates_[k].next) {
      const std::int32_t set = candidates_[k].set;
      if (set_of_[set] == set && sets_[set].reached + h_ == level) enliven(set, {minima++, level});
    }
  }
  return minima;
}

void BasinFilter::meet(std::int32_t a, std::int32_t b, int level) {
  if (a == LIVE) {
    enliven(b, {NONE, level});
  } else if (b == LIVE) {
    enliven(a, {NONE, level});
  } else if (sets_[a].size < sets_[b].size) {
    unite(b, a, level);
  } else {
    unite(a, b, level);
  }
}

void BasinFilter::unite(std::int32_t larger, std::int32_t smaller, int level) {
  std::int32_t basin = smaller;
  do {
    set_of_[basin] = larger;
    basin = next_in_set_[basin];
  } while (basin != smaller);
  std::swap(next_in_set_[larger], next_in_set_[smaller]);  // Two rings become one.

  Set& set = sets_[larger];
  const Set& other = sets_[smaller];
  set.size += other.size;
  areas_[larger] += areas_[smaller];
  if (other.reached < set.reached) {
    set.reached = other.reached;
    reach(larger, set.reached);
  } else if (set.reached == NEVER && areas_[larger] >= lambda_) {
    set.reached = level;
    reach(larger, level);
  }
}

// Notes that a set will be live h levels above the one where it reached lambda.
void BasinFilter::reach(std::int32_t set, int reached) {
  const int level = reached + h_;
  if (level >= Basins::SUMMIT_LEVEL) return;
  candidates_.push_back({set, candidates_of_[level]});
  candidates_of_[level] = static_cast<std::int32_t>(candidates_.size()) - 1;
}

void BasinFilter::enliven(std::int32_t set, Result result) {
  std::int32_t basin = set;
  do {
    set_of_[basin] = LIVE;
    results_[basin] = result;
    basin = next_in_set_[basin];
  } while (basin != set);
}

}  // namespace disparity_refinement
