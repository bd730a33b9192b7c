#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/segmentation/BasinFilter.hpp"
#include "disparity_refinement/segmentation/Basins.hpp"
#include "disparity_refinement/segmentation/CellGrid.hpp"
#include "disparity_refinement/segmentation/Connectivity.hpp"
#include "disparity_refinement/segmentation/CountSurface.hpp"
#include "disparity_refinement/segmentation/Watershed.hpp"

namespace disparity_refinement {

/// Area closing, H-minima and LC-WT of an 8-bit image, in this order: see BasinFilter and Watershed.
///
/// The time is linear in the number of pixels and hardly depends on lambda and h. Buffers are kept between
/// images: about 15 bytes a pixel for what cameras see, up to 36 for noise and patterns of single pixels,
/// which have more basins. One object serves one thread at a time.
class FilteredWatershed {
 public:
  static constexpr int MAX_STRIPS = 64;

  /// @param strips  The image is worked on in this number of strips, side by side if OpenCV has the threads;
  ///                the result is the same. Throws std::invalid_argument unless 1...MAX_STRIPS.
  explicit FilteredWatershed(int strips = 1);

  /// The image, CV_8UC1 of this size, for the caller to fill in place: it lies where compute() needs it.
  /// Valid until the next call with another size.
  /// @throws std::invalid_argument  for an image that is empty or too large for 32-bit indices.
  cv::Mat image(const cv::Size& size);

  /// Segments the image.
  /// @param lambda  Smallest area of a component that stays [px], >= 0; 0 and 1 close nothing.
  /// @param h       Smallest depth of a minimum that stays [gray levels], 0...255; 0 fills nothing.
  /// @param labels  CV_32SC1 of the image's size, 0 ... n - 1, numbered in raster order of the first pixels
  ///                of their minima; written in place if it has that type and size already.
  /// @return        n, the number of regional minima of the filtered image.
  /// @throws std::invalid_argument  for parameters out of range, or if there is no image.
  int compute(int lambda, int h, Connectivity connectivity, cv::Mat& labels);

  /// n for lambda = 0 ... max_lambda (rows) and h = 0 ... max_h (columns): see CountSurface.
  cv::Mat countSurface(int max_lambda, int max_h, Connectivity connectivity);

  /// The image, and what it is after both filters, CV_8UC1; not to be written. Valid from compute() to the
  /// next call.
  cv::Mat image() const { return view(cells_); }
  cv::Mat filtered() const { return view(filtered_cells_); }

 private:
  void buildBasins(Connectivity connectivity);
  void applyFilter(cv::Range cells);
  cv::Mat view(const std::vector<std::uint8_t>& cells) const {
    return grid_.image(const_cast<std::uint8_t*>(cells.data()));
  }

  int strips_;
  CellGrid grid_;
  Basins basins_;
  BasinFilter filter_;
  Watershed watershed_;
  CountSurface surface_;
  CellBuffers buffers_;
  std::vector<std::uint8_t> cells_, filtered_cells_;
};

}  // namespace disparity_refinement
