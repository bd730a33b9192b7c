#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "disparity_refinement/buffers.hpp"
#include "disparity_refinement/segmentation/CellGrid.hpp"
#include "disparity_refinement/segmentation/Connectivity.hpp"
#include "disparity_refinement/segmentation/PointerForest.hpp"

namespace disparity_refinement {

/// What the stages of the segmentation write into every cell, one stage after the other.
struct CellBuffers {
  /// Lower neighbours, then whether a cell is in a minimum, then directions.
  std::vector<std::uint8_t> codes;
  /// Nodes, then basins, then labels, then nodes again.
  std::vector<std::int32_t> ids;
  PointerForest forest;
  Scratch scratch;
};

/// Splits an 8-bit image f into basins, which is all that its lower components consist of.
///
/// A pixel is lower than another by (value, raster index), so that plateaus need no care. Every pixel with a
/// lower neighbour points to one; a basin is the set of pixels whose paths end in the same one. The component
/// of {f <= t} that holds a pixel p of value <= t is then the union of
///
///   - the pixels of value <= t of the basins that hang together through saddles of level <= t.
///
/// A saddle is a pixel whose lower neighbours do not hang together in the ring of its eight neighbours: only
/// there can components meet. These critical pixels, about a tenth of all, are found by Yokoi's number
/// (Yokoi, Toriwaki and Fukumura 1975).
///
/// Level 255 is left out: there every image is one component. Pixels of 255 without a lower neighbour make
/// one basin, SUMMIT.
class Basins {
 public:
  static constexpr int LEVELS = 256;
  static constexpr std::uint8_t SUMMIT_LEVEL = 255;
  static constexpr std::int32_t SUMMIT = 0;

  struct Saddle {
    std::int32_t a, b;  ///< The two basins that meet.
  };

  /// @param image    All cells of the grid; 255 in its frame. Not copied.
  /// @param buffers  ids will hold the basin of every cell, scratch the pixels by level, for as long as they
  ///                 are visited.
  void build(const CellGrid& grid, const std::uint8_t* image, Connectivity connectivity, int strips,
             CellBuffers& buffers);

  /// The image of the last build().
  const std::uint8_t* image() const { return image_; }
  int pixelCount() const { return grid_.size().area(); }

  /// Number of basins, SUMMIT among them.
  int size() const { return size_; }

  /// Calls visit(pixels), where pixels[i] is the basin of the i-th pixel by level: 16-bit numbers if that is
  /// enough, as there are many.
  template <typename Visitor>
  auto visitPixels(const CellBuffers& buffers, const Visitor& visit) const {
    return isSmall() ? visit(buffers.scratch.data<std::uint16_t>())
                     : visit(buffers.scratch.data<std::int32_t>());
  }
  /// The pixels of a level below SUMMIT_LEVEL.
  cv::Range pixelsOf(int level) const { return {pixel_begin_[level], pixel_begin_[level + 1]}; }

  /// The cells that have no earlier lower neighbour, in raster order; where strips meet there are others too.
  /// The first startCount() of them count.
  const std::vector<std::int32_t>& starts() const { return starts_; }
  int startCount() const { return start_count_; }

  const Saddle* saddles() const { return saddles_.data(); }
  /// The saddles of a level below SUMMIT_LEVEL.
  cv::Range saddlesOf(int level) const { return {saddle_begin_[level], saddle_begin_[level + 1]}; }

 private:
  using Histogram = std::array<std::int32_t, LEVELS>;
  using LevelBegins = std::array<int, LEVELS + 1>;
  /// What a strip adds to the counting sorts: first how many there are of every level, then where the next
  /// one goes. The pixels of even and of odd cells are counted apart, for neighbours often share a level, and
  /// two increments of one number would have to wait for each other.
  struct Strip {
    cv::Range cells;
    Histogram even_pixels, odd_pixels, saddles;
  };

  bool isSmall() const { return size_ <= 1 << 16; }
  template <int neighbour_count>
  void findLowerNeighbours(cv::Range cells, std::uint8_t* lower);
  void countPixels(Strip& strip);
  /// Turns the counts of every level into the places where the first ones of a strip go, and notes where the
  /// levels begin. counts_of(strip) is an array of pointers to the histograms concerned.
  template <typename CountsOf>
  void layOutLevels(const CountsOf& counts_of, LevelBegins& begins);
  template <typename Index>
  void sortPixels(Strip& strip, const std::int32_t* basin_of_node, std::int32_t* ids, Index* pixels);
  /// Calls visit(level, saddle) for every saddle of a strip.
  template <typename Visitor>
  void visitSaddles(const Strip& strip, const CellBuffers& buffers, const Visitor& visit) const;

  CellGrid grid_;
  const std::uint8_t* image_ = nullptr;
  Connectivity connectivity_ = Connectivity::EIGHT;
  std::vector<Strip> strips_;
  std::vector<std::uint32_t> critical_;  // A bit for every cell of a block.
  std::vector<std::int32_t> starts_;
  std::vector<Saddle> saddles_;
  LevelBegins pixel_begin_{}, saddle_begin_{};
  int size_ = 0, start_count_ = 0;
};

}  // namespace disparity_refinement
