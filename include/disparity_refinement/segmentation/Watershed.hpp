#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/segmentation/Basins.hpp"
#include "disparity_refinement/segmentation/CellGrid.hpp"
#include "disparity_refinement/segmentation/Connectivity.hpp"

namespace disparity_refinement {

/// Local condition watershed, LC-WT (Bieniek and Moga 2000): every pixel takes the label of the regional
/// minimum at the end of its path of steepest descent. There are no line pixels.
///
/// - A pixel with a lower neighbour points to its lowest neighbour. A pixel of a plateau without one points
///   to a neighbour on the plateau that is one step nearer to an exit (geodesic distance inside the plateau).
/// - Ties are broken in the order W, E, N, S, NW, NE, SW, SE.
///
/// The definition is local, so the result depends neither on a scan order nor on threads. The time is linear
/// in the number of pixels. Buffers are kept between images; one object serves one thread at a time.
class Watershed {
 public:
  /// Codes of a cell that lies in a regional minimum, or in the frame, and of any other pixel.
  static constexpr std::uint8_t STAYS = 18, UNDECIDED = 255;

  /// @param image    All cells of the grid; 255 in its frame.
  /// @param count    Number of regional minima.
  /// @param buffers  codes: STAYS or UNDECIDED, ids: the label, 0 ... count - 1, of every cell that STAYS;
  ///                 both are overwritten, and scratch.
  /// @param labels   CV_32SC1 of the grid's size; written in place.
  void compute(const CellGrid& grid, const std::uint8_t* image, Connectivity connectivity, int count,
               int strips, CellBuffers& buffers, cv::Mat& labels);

 private:
  template <int neighbour_count>
  void findDirections(int strips, Scratch& scratch);
  template <int neighbour_count>
  int pointToLowestNeighbours(cv::Range cells);
  template <int neighbour_count>
  int pointToExits(cv::Range cells, int end);
  template <int neighbour_count>
  void crossPlateaus(int end);

  CellGrid grid_;
  const std::uint8_t* image_ = nullptr;
  std::uint8_t* codes_ = nullptr;
  std::vector<std::uint8_t> exit_levels_;  // The level of a cell with a lower neighbour, 0 of the others.
  std::int32_t* queue_ = nullptr;
  std::vector<int> queue_begin_, queue_end_;  // Of every strip.
};

}  // namespace disparity_refinement
