#include "disparity_refinement/segmentation/FilteredWatershed.hpp"

#include <algorithm>
#include <string>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/segmentation/branchless.hpp"
#include "disparity_refinement/segmentation/buffers.hpp"
#include "disparity_refinement/segmentation/strips.hpp"

namespace disparity_refinement {

FilteredWatershed::FilteredWatershed(int strips) : strips_(strips) {
  requireArgument(strips >= 1 && strips <= MAX_STRIPS, "strips", strips, "1..." + std::to_string(MAX_STRIPS));
}

cv::Mat& FilteredWatershed::image(const cv::Size& size) {
  requireArgument(size.width > 0 && size.height > 0, "image size",
                  std::to_string(size.width) + "x" + std::to_string(size.height), "at least 1x1");
  const CellGrid grid(size);
  if (grid != grid_) {
    grid_ = grid;
    for (auto* cells : {&cells_, &filtered_cells_}) {
      growTo(*cells, grid.capacity());
      grid.fillFrame(cells->data(), Basins::SUMMIT_LEVEL);
    }
    image_ = grid.image(cells_.data());
    filtered_ = grid.image(filtered_cells_.data());
  }
  return image_;
}

int FilteredWatershed::compute(int lambda, int h, Connectivity connectivity, cv::Mat& labels) {
  validateFilter(lambda, h);
  buildBasins(connectivity);
  const int count = filter_.run(basins_, static_cast<int>(image_.total()), lambda, h);
  numberMinima(count);
  forEachStrip(strips_, [&](int i) { applyFilter(grid_.strip(i, strips_)); });
  watershed_.compute(grid_, filtered_cells_.data(), connectivity, count, strips_, buffers_, labels);
  return count;
}

cv::Mat FilteredWatershed::countSurface(int max_lambda, int max_h, Connectivity connectivity) {
  validateSurface(max_lambda, max_h);
  buildBasins(connectivity);
  return surface_.compute(basins_, static_cast<int>(image_.total()), max_lambda, max_h);
}

void FilteredWatershed::buildBasins(Connectivity connectivity) {
  requireArgument(!image_.empty(), "image", "empty", "image(size) to be called and filled first");
  basins_.build(grid_, cells_.data(), connectivity, strips_, buffers_);
}

// The first pixel of a minimum in raster order has no earlier neighbour that is as low: it makes a node.
void FilteredWatershed::numberMinima(int count) {
  std::vector<BasinFilter::Result>& results = filter_.results();
  const PointerForest& forest = buffers_.forest;
  growTo(numbers_, count);
  std::fill_n(numbers_.begin(), count, BasinFilter::NONE);
  int next = 0;
  for (int node = 0; node < forest.size() && next < count; ++node) {
    const BasinFilter::Result& result = results[forest.values()[node]];
    if (result.minimum == BasinFilter::NONE || numbers_[result.minimum] != BasinFilter::NONE) continue;
    if (cells_[forest.cellOf(node)] <= result.level) numbers_[result.minimum] = next++;
  }
  for (int basin = 0; basin < basins_.size(); ++basin) {
    std::int32_t& minimum = results[basin].minimum;
    if (minimum != BasinFilter::NONE) minimum = numbers_[minimum];
  }
}

void FilteredWatershed::applyFilter(cv::Range cells) {
  const BasinFilter::Result* results = filter_.results().data();
  const std::uint8_t* image = cells_.data();
  std::uint8_t* filtered = filtered_cells_.data();
  std::uint8_t* codes = buffers_.codes.data();
  std::int32_t* ids = buffers_.ids.data();
  for (int p = cells.start, end = cells.end; p < end; ++p) {
    const BasinFilter::Result result = results[ids[p]];
    const int value = image[p];
    const bool is_minimum = (value <= result.level) & (result.minimum != BasinFilter::NONE);
    filtered[p] = static_cast<std::uint8_t>(std::max(value, result.level));
    codes[p] = static_cast<std::uint8_t>(select(is_minimum, Watershed::STAYS, Watershed::UNDECIDED));
    ids[p] = result.minimum;
  }
}

}  // namespace disparity_refinement
