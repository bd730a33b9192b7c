#include "disparity_refinement/segmentation/FilteredWatershed.hpp"

#include <algorithm>
#include <string>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/segmentation/branchless.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {

FilteredWatershed::FilteredWatershed(int strips) : strips_(strips) {
  requireArgument(strips >= 1 && strips <= MAX_STRIPS, "strips", strips, "1..." + std::to_string(MAX_STRIPS));
}

cv::Mat FilteredWatershed::image(const cv::Size& size) {
  requireArgument(size.width > 0, "width of the image", size.width, "at least 1");
  requireArgument(size.height > 0, "height of the image", size.height, "at least 1");
  const CellGrid grid(size);
  if (grid != grid_) {
    for (auto* cells : {&cells_, &filtered_cells_}) {
      cells->resize(grid.capacity());
      grid.fillFrame(cells->data(), Basins::SUMMIT_LEVEL);
    }
    grid_ = grid;  // Last: without the memory the former image would stay.
  }
  return image();
}

int FilteredWatershed::compute(int lambda, int h, Connectivity connectivity, cv::Mat& labels) {
  validateFilter(lambda, h);
  buildBasins(connectivity);
  const int count = filter_.run(basins_, buffers_, lambda, h);
  forEachStrip(strips_, [&](int i) { applyFilter(grid_.strip(i, strips_)); });
  watershed_.compute(grid_, filtered_cells_.data(), connectivity, count, strips_, buffers_, labels);
  return count;
}

cv::Mat FilteredWatershed::countSurface(int max_lambda, int max_h, Connectivity connectivity) {
  validateSurface(max_lambda, max_h);
  buildBasins(connectivity);
  return surface_.compute(basins_, buffers_, max_lambda, max_h);
}

void FilteredWatershed::buildBasins(Connectivity connectivity) {
  requireArgument(grid_.rows() > 0, "image", "empty", "image(size) to be called and filled first");
  basins_.build(grid_, cells_.data(), connectivity, strips_, buffers_);
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
