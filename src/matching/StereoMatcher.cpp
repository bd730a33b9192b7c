#include "disparity_refinement/matching/StereoMatcher.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>

#include "disparity_refinement/StereoGeometry.hpp"
#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

constexpr int SUBPIXEL_STEPS = cv::StereoMatcher::DISP_SCALE;
// OpenCV marks a pixel without disparity by its min_disparity - 1; its min_disparity is 0 here, see
// matchBlocks().
constexpr short FIXED_POINT_INVALID = -SUBPIXEL_STEPS;
static_assert(CensusSgm::INVALID == FIXED_POINT_INVALID && CensusSgm::SUBPIXEL_STEPS == SUBPIXEL_STEPS,
              "all matchers have one fixed point");

void requireInRange(const std::string& name, int value, int min, int max) {
  requireArgument(value >= min && value <= max, name, value,
                  std::to_string(min) + "..." + std::to_string(max));
}

void requireOddInRange(const std::string& name, int value, int min, int max) {
  requireArgument(value >= min && value <= max && value % 2 != 0, name, value,
                  "an odd number in " + std::to_string(min) + "..." + std::to_string(max));
}

// Those of SGBM; 0 stands for a multiple of the block's area.
int penalty(int value, int factor, int window) { return value > 0 ? value : factor * window * window; }

int effectiveP1(const MatchingParameters& p) { return penalty(p.P1, 8, p.correlation_window_size); }

int effectiveP2(const MatchingParameters& p) { return penalty(p.P2, 32, p.correlation_window_size); }

CensusSgmParameters censusParameters(const MatchingParameters& p) {
  CensusSgmParameters census;
  census.min_disparity = p.min_disparity;
  census.disparity_range = p.disparity_range;
  if (p.P1 > 0) census.p1 = p.P1;
  if (p.P2 > 0) census.p2 = p.P2;
  census.uniqueness_ratio = p.uniqueness_ratio;
  census.disp12_max_diff = p.disp12MaxDiff;
  census.aggregate_rows = p.aggregate_rows;
  return census;
}

auto members(const MatchingParameters& p) {
  return std::tie(p.stereo_algorithm, p.sgbm_mode, p.prefilter_size, p.prefilter_cap,
                  p.correlation_window_size, p.min_disparity, p.disparity_range, p.uniqueness_ratio,
                  p.texture_threshold, p.speckle_size, p.speckle_range, p.P1, p.P2, p.disp12MaxDiff,
                  p.full_width, p.aggregate_rows);
}

cv::Ptr<cv::StereoMatcher> createBlockMatcher(const MatchingParameters& p) {
  if (p.stereo_algorithm == StereoAlgorithm::BM) {
    const cv::Ptr<cv::StereoBM> matcher = cv::StereoBM::create(p.disparity_range, p.correlation_window_size);
    matcher->setPreFilterSize(p.prefilter_size);
    matcher->setPreFilterCap(p.prefilter_cap);
    matcher->setTextureThreshold(p.texture_threshold);
    matcher->setUniquenessRatio(p.uniqueness_ratio);
    matcher->setSpeckleWindowSize(p.speckle_size);
    // BM takes steps of its fixed point, SGBM pixels.
    matcher->setSpeckleRange(p.speckle_range * SUBPIXEL_STEPS);
    matcher->setDisp12MaxDiff(-1);
    return matcher;
  }
  // SGBM takes everything below 1 for 1; a difference as large as the range lets all disparities pass.
  const int disp12_max_diff = p.disp12MaxDiff < 0 ? p.disparity_range : p.disp12MaxDiff;
  return cv::StereoSGBM::create(0, p.disparity_range, p.correlation_window_size, effectiveP1(p),
                                effectiveP2(p), disp12_max_diff, p.prefilter_cap, p.uniqueness_ratio,
                                p.speckle_size, p.speckle_range, static_cast<int>(p.sgbm_mode));
}

void requireSearchableSize(const cv::Size& size, const MatchingParameters& p) {
  const int window = p.correlation_window_size;
  // Columns of the left image of which not all candidates lie in the right image.
  const int unmatched_columns = std::max(p.disparity_range + std::max(p.min_disparity, 0), -p.min_disparity);
  requireArgument(size.width >= unmatched_columns + window, "width of the images", size.width,
                  "at least " + std::to_string(unmatched_columns + window) + " for disparity_range " +
                      std::to_string(p.disparity_range) + ", min_disparity " +
                      std::to_string(p.min_disparity) + " and correlation_window_size " +
                      std::to_string(window));

  int min_height = 1;
  if (p.stereo_algorithm == StereoAlgorithm::BM) {
    min_height = window + 1;
  } else if (p.sgbm_mode == SgbmMode::SGBM_3WAY) {
    // Each of the four stripes, ceil(height / 4) rows, must be at least as high as the rows before it that
    // OpenCV takes along, window / 2 + 1 + ceil(stripe / 10); otherwise it mixes up the rows of its result.
    const int stripe = (10 * (window / 2 + 1) + 8) / 9;
    min_height = 4 * stripe - 3;
  }
  requireArgument(
      size.height >= min_height, "height of the images", size.height,
      "at least " + std::to_string(min_height) + " for correlation_window_size " + std::to_string(window));
}

/// The columns first ... first + width - 1 of an image, which is reflected at its left and right border;
/// `buffer` is used only if it has to be.
cv::Mat columns(const cv::Mat& image, int first, int width, cv::Mat& buffer) {
  const int last = first + width;
  cv::Mat inside = image.colRange(std::max(first, 0), std::min(last, image.cols));
  const int left = std::max(-first, 0);
  const int right = std::max(last - image.cols, 0);
  if (left == 0 && right == 0) return inside;
  cv::copyMakeBorder(inside, buffer, 0, 0, left, right, cv::BORDER_REFLECT | cv::BORDER_ISOLATED);
  return buffer;
}

}  // namespace

void validate(const MatchingParameters& p) {
  requireInRange("stereo_algorithm", static_cast<int>(p.stereo_algorithm), 0, 2);
  requireInRange("min_disparity", p.min_disparity, -2048, 2048);
  requireArgument(p.disparity_range >= 16 && p.disparity_range <= 2048 && p.disparity_range % 16 == 0,
                  "disparity_range", p.disparity_range, "a multiple of 16 in 16...2048");
  requireInRange("uniqueness_ratio", p.uniqueness_ratio, 0, 99);
  requireArgument(p.speckle_size >= 0, "speckle_size", p.speckle_size, "at least 0");
  requireInRange("speckle_range", p.speckle_range, 0, 4096);

  if (p.stereo_algorithm == StereoAlgorithm::CENSUS_SGM) {
    requireInRange("disp12MaxDiff", p.disp12MaxDiff, -1, 4096);
    requireArgument(p.P1 >= 0, "P1", p.P1, "at least 0");
    requireArgument(p.P2 >= 0, "P2", p.P2, "at least 0");
    const CensusSgmParameters census = censusParameters(p);
    requireArgument(census.p2 > census.p1, "P2", census.p2,
                    "more than P1, which is " + std::to_string(census.p1));
    validate(census);
    return;
  }
  requireInRange("prefilter_cap", p.prefilter_cap, 1, 63);
  if (p.stereo_algorithm == StereoAlgorithm::BM) {
    requireOddInRange("correlation_window_size", p.correlation_window_size, 5, 255);
    requireOddInRange("prefilter_size", p.prefilter_size, 5, 255);
    requireInRange("texture_threshold", p.texture_threshold, 0, 10000);
  } else {
    requireOddInRange("correlation_window_size", p.correlation_window_size, 1, 15);
    requireInRange("sgbm_mode", static_cast<int>(p.sgbm_mode), 0, 3);
    requireInRange("disp12MaxDiff", p.disp12MaxDiff, -1, 4096);
    requireArgument(p.P1 >= 0, "P1", p.P1, "at least 0");
    requireArgument(p.P2 >= 0, "P2", p.P2, "at least 0");
    const int p1 = effectiveP1(p), p2 = effectiveP2(p);
    requireArgument(p2 > p1 && p2 <= 16383, "P2", p2,
                    "more than P1, which is " + std::to_string(p1) + ", and at most 16383");
  }
}

StereoMatcher::StereoMatcher(const MatchingParameters& parameters) { setParameters(parameters); }

void StereoMatcher::setParameters(const MatchingParameters& parameters) {
  // A new matcher of OpenCV would allocate its buffers anew.
  if (block_matcher_ && members(parameters) == members(parameters_)) return;
  validate(parameters);
  block_matcher_ =
      parameters.stereo_algorithm == StereoAlgorithm::CENSUS_SGM ? nullptr : createBlockMatcher(parameters);
  parameters_ = parameters;
}

DisparityRange StereoMatcher::range(double principal_point_offset) const {
  DisparityRange range;
  range.min = static_cast<float>(parameters_.min_disparity) - static_cast<float>(principal_point_offset);
  range.max = range.min + static_cast<float>(parameters_.disparity_range);
  return range;
}

cv::Rect StereoMatcher::validWindow(const cv::Size& size) const {
  const MatchingParameters& p = parameters_;
  const cv::Rect image({0, 0}, size);
  // The continued images have no columns without candidates.
  const int min_disparity = p.full_width ? 0 : p.min_disparity;
  const int disparities = p.full_width ? 1 : p.disparity_range;
  const int block =
      p.stereo_algorithm == StereoAlgorithm::CENSUS_SGM ? CensusPlanes::WIDTH : p.correlation_window_size;
  return cv::getValidDisparityROI(image, image, min_disparity, disparities, block) & image;
}

cv::Range StereoMatcher::matchBlocks(const cv::Mat& left, const cv::Mat& right) {
  requireSearchableSize(left.size(), parameters_);
  // OpenCV always searches the disparities from 0 on, in images of which the right one is shifted by
  // min_disparity: its BM writes past the ends of the rows if it is told min_disparity itself.
  const int first = parameters_.full_width ? -parameters_.disparity_range : parameters_.min_disparity;
  const int width = parameters_.full_width ? left.cols + parameters_.disparity_range
                                           : left.cols - std::max(parameters_.min_disparity, 0);
  block_matcher_->compute(columns(left, first, width, padded_left_),
                          columns(right, first - parameters_.min_disparity, width, padded_right_),
                          fixed_point_);
  return {first, first + width};
}

cv::Range StereoMatcher::matchCensus(const cv::Mat& left, const cv::Mat& right) {
  census_matcher_.compute(left, right, censusParameters(parameters_), fixed_point_,
                          std::max(1, cv::getNumThreads()));
  if (!parameters_.full_width) {
    // As OpenCV has it: where not all candidates lie in the right image.
    const int min = parameters_.min_disparity, end = std::max(min + parameters_.disparity_range, 0);
    fixed_point_.colRange(0, std::min(end, left.cols)) = FIXED_POINT_INVALID;
    fixed_point_.colRange(std::max(left.cols + std::min(min, 0), 0), left.cols) = FIXED_POINT_INVALID;
  }
  if (parameters_.speckle_size > 0) {
    speckle_filter_.apply(fixed_point_, FIXED_POINT_INVALID, parameters_.speckle_size,
                          parameters_.speckle_range * SUBPIXEL_STEPS);
  }
  return {0, left.cols};
}

void StereoMatcher::compute(const cv::Mat& left, const cv::Mat& right, cv::Mat& disparity,
                            double principal_point_offset) {
  requireImage(left, "left", CV_8UC1);
  requireImage(right, "right", CV_8UC1, left.size());
  if (!(std::abs(principal_point_offset) <= MAX_PRINCIPAL_POINT_OFFSET)) {
    requireArgument(false, "principal_point_offset", principal_point_offset,
                    "at most " + std::to_string(MAX_PRINCIPAL_POINT_OFFSET) + " in size");
  }
  const cv::Size size = left.size();
  const cv::Range matched = parameters_.stereo_algorithm == StereoAlgorithm::CENSUS_SGM
                                ? matchCensus(left, right)
                                : matchBlocks(left, right);

  const DisparityRange range = this->range(principal_point_offset);
  const int begin = std::max(matched.start, 0);
  const int end = std::min(matched.end, size.width);
  disparity.create(size, CV_32FC1);
  for (int y = 0; y < size.height; ++y) {
    const short* fixed_point = fixed_point_.ptr<short>(y);
    float* row = disparity.ptr<float>(y);
    std::fill(row, row + begin, range.invalid());
    for (int x = begin; x < end; ++x) {
      const short d = fixed_point[x - matched.start];
      row[x] =
          d == FIXED_POINT_INVALID ? range.invalid() : range.min + static_cast<float>(d) / SUBPIXEL_STEPS;
    }
    std::fill(row + end, row + size.width, range.invalid());
  }
  keepOneInvalid(disparity, range);
}

}  // namespace disparity_refinement
