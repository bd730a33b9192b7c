#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/matching/CensusPlanes.hpp"

namespace disparity_refinement {

struct CensusPathsFunctions;
struct CensusPathsInput;

struct CensusSgmParameters {
  static constexpr int MAX_DISPARITY_RANGE = 2048;
  static constexpr int MAX_P2 = 224;  ///< With the largest cost it fits into a byte.

  int min_disparity = 0;      ///< Smallest disparity searched [px], -2048...2048.
  int disparity_range = 128;  ///< Number of disparities searched [px], 1...MAX_DISPARITY_RANGE.
  int p1 = 6;                 ///< Penalty of a disparity step of 1 px, 0...p2.
  int p2 = 50;                ///< Penalty of a larger step, at most MAX_P2.
  int uniqueness_ratio = 0;   ///< Margin by which the least sum must beat others [%], 0...99.
  int disp12_max_diff = 1;    ///< Largest difference to the disparity of the right view [px]; < 0: no check.
  bool aggregate_rows = false;  ///< Costs are averages over three rows as well.
};

/// Throws std::invalid_argument that names the parameter, its value and what is expected.
void validate(const CensusSgmParameters& parameters);

/// Semi-global matching (Hirschmueller, PAMI 2008) along four paths on costs of one byte.
///
/// The cost c(x, d) of a single pixel is the number of differing bits of a centre-symmetric census transform
/// and the difference of the slopes (CensusPlanes); 10 where d leads outside of the right image. The paths
/// take the averages along the row C(x, d) = avg(avg(c(x - 1, d), c(x + 1, d)), c(x, d)), rounded upwards
/// twice: avg(a, b) = (a + b + 1) / 2. At the borders the pixel itself stands for the neighbour that is
/// missing. Averages have less of the noise of single pixels, and on slanted walls more disparities pass the
/// left-right check. With aggregate_rows they take the same averages of C over the columns, of the rows above
/// and below and that of the pixel itself: fewer errors, for more time.
///
/// A path value is L(p, d) = C(p, d) + min(L'(d), L'(d - 1) + P1, L'(d + 1) + P1, P2), L' the values of the
/// pixel before less their least one. The disparity of a pixel has the least sum of the four; sums are cut at
/// 255, and the smallest disparity wins a tie. The same sums give the right view's disparities for the
/// left-right check.
///
/// The path from below needs no volume of the frame: it is computed once up to the first rows, its values are
/// kept at some rows, and it starts again from them for the rows between. Everything is exact, so that the
/// result is the same bit for bit for any number of threads and any width of the vectors.
///
/// Buffers are kept between frames; one object serves one thread at a time.
class CensusSgm {
 public:
  enum class Vectors { WIDEST, BYTES_16 };

  static constexpr int SUBPIXEL_STEPS = 16;          ///< Of a pixel in the result, as in OpenCV's matchers.
  static constexpr short INVALID = -SUBPIXEL_STEPS;  ///< Value of a pixel without disparity.

  /// @param vectors  BYTES_16: only what every processor has.
  explicit CensusSgm(Vectors vectors = Vectors::WIDEST);

  /// @param left, right  CV_8UC1, of the same size, not empty.
  /// @param disparity    CV_16SC1 [1/16 px], less min_disparity; INVALID where ambiguous, where the
  ///                     left-right check fails and where the best match lies outside of the right image.
  ///                     Every other pixel has the median of 3 x 3 disparities.
  /// @param threads      Parts that are computed side by side, >= 1.
  /// @throws std::invalid_argument  for images of another type or size, empty ones and bad parameters.
  void compute(const cv::Mat& left, const cv::Mat& right, const CensusSgmParameters& parameters,
               cv::Mat& disparity, int threads = 1);

 private:
  // What belongs to a strip of rows: it is computed by one thread.
  struct Strip {
    cv::Mat state;        // Of the path from above: the values of the row before, less their least ones.
    cv::Mat costs, sums;  // Of the rows of a block.
    cv::Mat cost_rows;    // See CostRows.
    std::vector<std::uint16_t> winners, right_winners;
    std::vector<std::int8_t> subpixel;
    std::vector<std::uint8_t> is_ambiguous;
  };

  void prepare(const cv::Size& size, const CensusSgmParameters& parameters);
  void mirror(const cv::Mat (&planes)[3], int min_disparity, int threads);
  // The values of the vertical paths where they enter the blocks and strips.
  void sweep(const CensusPathsInput& input, int threads);
  void computeBlock(const CensusPathsInput& input, const CensusSgmParameters& parameters,
                    const cv::Range& rows, std::uint8_t* state, Strip& strip);
  void finishRow(const CensusPathsInput& input, const CensusSgmParameters& parameters, int y,
                 const std::uint8_t* sums, Strip& strip);

  const CensusPathsFunctions* functions_;
  CensusPlanes left_, right_;
  int vectors_ = 0;
  cv::Mat mirrored_[3], inside_;
  std::vector<std::uint8_t> row_inside_, beyond_, low_bytes_, high_bytes_;
  std::vector<std::uint16_t> place_;
  std::vector<std::uint8_t> ambiguous_;
  cv::Mat states_;  // Of the path from below, where it enters the blocks of rows.
  std::vector<Strip> strips_;
  cv::Mat unchecked_, is_bad_;
};

}  // namespace disparity_refinement
