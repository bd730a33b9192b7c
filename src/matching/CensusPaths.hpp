#pragma once

#include <cstddef>
#include <cstdint>

namespace disparity_refinement {

/// A frame as the inner loops of CensusSgm see it. Plain pointers and numbers: the loops are compiled for
/// several processors, and must not share any function of the standard library.
///
/// Striped layout (Farrar, Bioinformatics 2007): the values of all disparities d of a pixel lie in R vectors
/// of N bytes; vector r holds d = i R + r in lane i, so that d - 1 and d + 1 are the same lane of a
/// neighbouring vector. Values beyond the last disparity are there to fill the vectors, and never win.
struct CensusPathsInput {
  int width, height, disparities;
  int min_disparity;
  int vectors;  ///< R, for the N of the functions used: least R with N R >= disparities.

  /// Planes of CensusPlanes of the left image.
  const std::uint8_t* left[3];
  std::ptrdiff_t left_step;

  /// The planes of the right image, mirrored: position j = width - 1 - x + d of a row is the pixel that x is
  /// compared with at d. A row has 2 R - 1 phases: phase f holds the positions f, f + R, f + 2 R...
  const std::uint8_t* right[3];
  std::ptrdiff_t right_step, phase_step;
  /// The same for a row of 255 for positions inside the right image, and 0 outside.
  const std::uint8_t* inside;
  /// Striped: 255 beyond the last disparity, otherwise 0.
  const std::uint8_t* beyond;
  /// Striped: d modulo 256 and d / 256.
  const std::uint8_t *low_bytes, *high_bytes;
  /// Index of a disparity inside the striped layout.
  const std::uint16_t* place;

  std::uint8_t p1, p2;
  bool aggregate_rows;  ///< Costs are averages over three rows.
  /// By the least sum of a pixel: the largest sum by which another disparity makes it ambiguous. Null: none
  /// does.
  const std::uint8_t* ambiguous;
};

/// What findWinners() tells of a row.
struct CensusWinners {
  std::uint16_t* disparity;  ///< Disparity of the least sum of every pixel, less min_disparity [px].
  std::int8_t* subpixel;     ///< What is to be added to it [1/16 px].
  std::uint8_t* is_ambiguous;
  /// The same disparity of the right view: of the pixel that x is compared with at d in element x - d. It
  /// points into an array with disparities - 1 elements before it.
  std::uint16_t* right_disparity;
};

/// What a step of a vertical path to a row needs for averages over rows; unused without aggregate_rows.
struct CensusCostRows {
  std::uint8_t* here;    ///< Costs of this row.
  std::uint8_t* beside;  ///< Those of the row before; the step leaves those of the row after here.
  int after;             ///< The row that the path goes to next.
};

/// The inner loops. All work on rows y of costs, path values and sums, of width pixels with the striped
/// values of all disparities each.
struct CensusPathsFunctions {
  int lanes;  ///< N

  /// The costs of row y, not averaged over rows, in the columns x_begin ... x_end - 1.
  void (*findCosts)(const CensusPathsInput& input, int y, int x_begin, int x_end, std::uint8_t* costs);
  /// One step of vertical paths to row y in these columns. `state` has the path values of the row before less
  /// their least one, and then those of this row.
  void (*step)(const CensusPathsInput& input, int y, int x_begin, int x_end, const CensusCostRows& rows,
               std::uint8_t* state);
  /// The same for a whole row; keeps its costs and path values.
  void (*stepAndKeep)(const CensusPathsInput& input, int y, const CensusCostRows& rows, std::uint8_t* state,
                      std::uint8_t* costs, std::uint8_t* values);
  /// Adds the path from above and that from the left to the sums of a row, and the path from the right to
  /// those of the row before. Either row may be absent (null).
  void (*addPaths)(const CensusPathsInput& input, const std::uint8_t* costs, std::uint8_t* state,
                   std::uint8_t* sums, const std::uint8_t* costs_before, std::uint8_t* sums_before);
  void (*findWinners)(const CensusPathsInput& input, const std::uint8_t* sums, const CensusWinners& winners);
};

constexpr int MAX_DISPARITIES = 2048;

/// Largest cost: 16 census bits and the slope.
constexpr int MAX_CENSUS_COST = 31;
/// Cost of a disparity that leads out of the right image.
constexpr int OUTSIDE_CENSUS_COST = 10;

/// Vectors of 16 bytes, which every processor has.
const CensusPathsFunctions& censusPaths16();
/// Vectors of 32 bytes; only for a processor with AVX2. Null where the compiler does not know it.
const CensusPathsFunctions* censusPaths32();

}  // namespace disparity_refinement
