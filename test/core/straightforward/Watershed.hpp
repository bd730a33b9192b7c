#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "PaddedImage.hpp"
#include "disparity_refinement/segmentation/Connectivity.hpp"

namespace disparity_refinement {
namespace straightforward {

/// Local condition watershed, LC-WT (Bieniek and Moga 2000): every pixel takes the label of the regional
/// minimum at the end of its path of steepest descent. There are no line pixels.
///
/// - A regional minimum is a flat zone without a lower neighbour; minima are numbered in raster order of
/// their
///   first pixel, from 0.
/// - A pixel with a lower neighbour points to its lowest neighbour. A pixel of a plateau without one points
/// to
///   a neighbour on the plateau that is one step nearer to an exit (geodesic distance inside the plateau).
/// - Ties are broken in the order W, E, N, S, NW, NE, SW, SE.
///
/// The definition is local, so the result depends neither on a scan order nor on threads. The time is linear
/// in the number of pixels. Buffers are kept between images; one object serves one thread at a time.
class Watershed {
 public:
  /// @param image   CV_8UC1, not empty; throws std::invalid_argument otherwise.
  /// @param labels  CV_32SC1 of the same size, 0 ... n - 1; written in place if it has that type and size.
  /// @return        n, the number of regional minima.
  int compute(const cv::Mat& image, Connectivity connectivity, cv::Mat& labels);

 private:
  /// What target_ holds for a pixel, beside the index of the cell that it points to: NONE if it points
  /// nowhere yet, ~label if its label is known. Cell 0 is in the frame and no target.
  static constexpr std::int32_t NONE = 0;
  /// What it holds for the frame: anything but NONE.
  static constexpr std::int32_t OUTSIDE = -1;

  /// Fills target_ and returns the number of minima.
  template <int neighbour_count>
  int findTargets();
  template <int neighbour_count>
  void pointToLowestNeighbours();
  template <int neighbour_count>
  void pointAcrossPlateaus();
  template <int neighbour_count>
  int labelMinima();

  /// The label at the end of a pixel's path, which all pixels on the path are given at once.
  std::int32_t followPath(std::int32_t pixel);

  PaddedImage image_;
  std::vector<std::int32_t> target_;
  std::vector<std::int32_t> queue_;
};

}  // namespace straightforward
}  // namespace disparity_refinement
