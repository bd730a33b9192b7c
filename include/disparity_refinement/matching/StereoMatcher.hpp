#pragma once

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/matching/CensusSgm.hpp"
#include "disparity_refinement/matching/SpeckleFilter.hpp"

namespace disparity_refinement {

/// OpenCV's block matching and semi-global block matching, and CensusSgm.
enum class StereoAlgorithm { BM = 0, SGBM = 1, CENSUS_SGM = 2 };

/// Modes of cv::StereoSGBM, with OpenCV's numbers.
enum class SgbmMode { SGBM = 0, HH = 1, SGBM_3WAY = 2, HH4 = 3 };

/// Parameters of the matchers, under the names of stereo_image_proc.
///
/// What belongs to some of the algorithms alone is neither used nor checked with the others.
struct MatchingParameters {
  StereoAlgorithm stereo_algorithm = StereoAlgorithm::SGBM;
  /// SGBM only: which paths are aggregated.
  SgbmMode sgbm_mode = SgbmMode::SGBM_3WAY;
  /// BM only: window of the prefilter [px], odd, 5...255. Without effect, as in stereo_image_proc: OpenCV's
  /// default prefilter, x-Sobel, has a fixed window.
  int prefilter_size = 9;
  /// BM and SGBM: bound of the prefiltered values, 1...63.
  int prefilter_cap = 63;
  /// BM and SGBM: side of the matched block [px], odd; BM 5...255, SGBM 1...15. Larger: smoother, safer,
  /// coarser. OpenCV's SGBM sums costs in 16 bits, which do not hold those of larger blocks; it
  /// recommends 3...11.
  int correlation_window_size = 5;
  /// Smallest disparity searched [px], -2048...2048.
  int min_disparity = 0;
  /// Number of disparities searched [px]: a multiple of 16, 16...2048 (OpenCV's fixed point ends there).
  int disparity_range = 128;
  /// Margin by which the best cost must beat the second best [%], 0...99. Larger: fewer, safer disparities.
  int uniqueness_ratio = 10;
  /// BM only: least texture inside the block, 0...10000. Larger: fewer disparities on flat surfaces.
  int texture_threshold = 10;
  /// Regions of at most so many pixels are removed [px], >= 0; 0: none.
  int speckle_size = 100;
  /// Largest disparity step inside a region [px], 0...4096, for both algorithms.
  int speckle_range = 2;
  /// SGBM and CENSUS_SGM: penalty for a disparity step of 1 px, >= 0; 0: 8 * correlation_window_size^2, with
  /// CENSUS_SGM 6.
  int P1 = 0;
  /// SGBM and CENSUS_SGM: penalty for a larger step, greater than P1; 0: 32 * correlation_window_size^2, with
  /// CENSUS_SGM 50. At most 16383, as two of them must fit into 16 bits, with CENSUS_SGM 224: see there.
  int P2 = 0;
  /// SGBM and CENSUS_SGM: largest difference in the left-right check [px], at most 4096; -1: no check; with
  /// SGBM 0 counts as 1.
  /// OpenCV's BM has such a check too, but beyond a prefilter_cap of 31 it compares costs that it has not
  /// computed.
  int disp12MaxDiff = 1;
  /// Search up to the left border too. OpenCV leaves the first min_disparity + disparity_range columns empty;
  /// here both images are reflected at their borders by as many columns before matching. CENSUS_SGM needs no
  /// reflection, and the columns are emptied if this is false.
  bool full_width = false;
  /// CENSUS_SGM only: costs are averages over three rows as well, see CensusSgm. Fewer errors after the
  /// refinement of mode quality, for an eighth more time.
  bool aggregate_rows = false;
};

/// Throws std::invalid_argument that names the parameter, its value and what is expected.
void validate(const MatchingParameters& parameters);

/// All matchers behind one type. Buffers are kept between frames; one object serves one thread at a
/// time.
class StereoMatcher {
 public:
  explicit StereoMatcher(const MatchingParameters& parameters = {});

  /// Throws std::invalid_argument, and keeps the former parameters, if one is out of range.
  void setParameters(const MatchingParameters& parameters);
  const MatchingParameters& parameters() const { return parameters_; }

  /// Range of the disparities of compute() [px]: min_disparity ... min_disparity + disparity_range, shifted
  /// by -principal_point_offset.
  DisparityRange range(double principal_point_offset = 0.0) const;

  /// Where the whole block of a pixel and of all its candidates lies inside images of this size; the block of
  /// CENSUS_SGM is that of its census.
  cv::Rect validWindow(const cv::Size& size) const;

  /// Disparity map of a rectified pair.
  ///
  /// OpenCV reads and writes out of bounds in images that are hardly larger than what it searches, so they
  /// are refused: the width must be at least disparity_range + min_disparity + correlation_window_size (for a
  /// negative min_disparity: max(disparity_range, -min_disparity) + correlation_window_size), BM needs more
  /// rows and columns than its window has, and the four stripes of SGBM_3WAY need 4 * ceil((10 / 9) *
  /// (correlation_window_size / 2 + 1)) - 3 rows. CENSUS_SGM takes images of any size.
  ///
  /// @param left, right             CV_8UC1, of the same size.
  /// @param disparity               CV_32FC1 [px], at least one pixel invalid; written in place if it has
  ///                                that type and size already.
  /// @param principal_point_offset  cx_left - cx_right [px], subtracted from every disparity; at most
  ///                                MAX_PRINCIPAL_POINT_OFFSET in size.
  /// @throws std::invalid_argument  for images of another type, of different size, empty, or too small, and
  ///                                for a larger offset.
  void compute(const cv::Mat& left, const cv::Mat& right, cv::Mat& disparity,
               double principal_point_offset = 0.0);

 private:
  // Both write fixed_point_ and return the columns of the image that it has.
  cv::Range matchBlocks(const cv::Mat& left, const cv::Mat& right);
  cv::Range matchCensus(const cv::Mat& left, const cv::Mat& right);

  MatchingParameters parameters_;
  cv::Ptr<cv::StereoMatcher> block_matcher_;
  CensusSgm census_matcher_;
  SpeckleFilter speckle_filter_;
  cv::Mat padded_left_, padded_right_, fixed_point_;
};

}  // namespace disparity_refinement
