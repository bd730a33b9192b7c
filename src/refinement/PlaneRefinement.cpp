#include "disparity_refinement/refinement/PlaneRefinement.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core/hal/intrin.hpp>
#include <string>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

// A float is at least this if, and only if, it is at least `bound`.
float roundedUp(double bound) {
  const float rounded = static_cast<float>(bound);
  return rounded < bound ? std::nextafter(rounded, std::numeric_limits<float>::infinity()) : rounded;
}

// a x + start in four columns from x on. In double precision, for the start, at column 0, may be far larger
// than the plane is inside its segment.
cv::v_float32x4 planeAt(double a, double start, int x) {
#if CV_SIMD128_64F
  const cv::v_int32x4 columns = cv::v_setall_s32(x) + cv::v_int32x4(0, 1, 2, 3);
  const cv::v_float64x2 slope = cv::v_setall_f64(a), offset = cv::v_setall_f64(start);
  return cv::v_cvt_f32(slope * cv::v_cvt_f64(columns) + offset, slope * cv::v_cvt_f64_high(columns) + offset);
#else
  const auto at = [&](int column) { return static_cast<float>(a * column + start); };
  return {at(x), at(x + 1), at(x + 2), at(x + 3)};
#endif
}

// Writes a plane back where conditions 1 and 4, which are decided per pixel, hold.
class Reprojection {
 public:
  Reprojection(const DisparityRange& range, double focal_length_times_baseline,
               const PlaneRefinementParameters& parameters)
      : range_(range),
        lowest_(std::numeric_limits<float>::lowest()),
        highest_(std::numeric_limits<float>::max()),
        min_value_(smallestPlaneDisparity(range, focal_length_times_baseline, parameters)),
        max_divergence_(static_cast<float>(parameters.max_divergence)),
        diverging_is_kept_(parameters.divergence_action == DivergenceAction::KEEP) {
    if (parameters.out_of_range_action == OutOfRangeAction::CLAMP) {
      lowest_ = range.min;
      highest_ = range.max;
    }
    if (parameters.divergence_action == DivergenceAction::TAKE_PLANE) {
      max_divergence_ = std::numeric_limits<float>::infinity();
    }
  }

  // Every pixel holds a valid disparity or range.invalid().
  void apply(const SegmentPlane& plane, RunSpan runs, cv::Mat& disparity) const {
    const Reprojection reproject = *this;  // A local copy stays in registers.
    for (const Run& run : runs) {
      reproject.applyToRun(plane.a, plane.b * run.y + plane.c, run.x_begin, run.x_end,
                           disparity.ptr<float>(run.y));
    }
  }

 private:
  void applyToRun(double a, double start, int begin, int end, float* row) const {
    const int last = end - 4;
    if (last < begin) {
      float four[4] = {};
      std::copy(row + begin, row + end, four);
      cv::v_store(four, refined(cv::v_load(four), planeAt(a, start, begin)));
      std::copy(four, four + (end - begin), row + begin);
      return;
    }
    // Some of the last four pixels the loop may meet too: they are read before it and written after it.
    const cv::v_float32x4 last_four = refined(cv::v_load(row + last), planeAt(a, start, last));
    for (int x = begin; x < last; x += 4) {
      cv::v_store(row + x, refined(cv::v_load(row + x), planeAt(a, start, x)));
    }
    cv::v_store(row + last, last_four);
  }

  // What becomes of pixels of disparity d where the plane is at `value`.
  cv::v_float32x4 refined(const cv::v_float32x4& d, cv::v_float32x4 value) const {
    const auto all = [](float number) { return cv::v_setall_f32(number); };
    value = cv::v_min(cv::v_max(value, all(lowest_)), all(highest_));
    const cv::v_float32x4 is_allowed = (value >= all(min_value_)) & (value <= all(range_.max));
    const cv::v_float32x4 is_hole = d < all(range_.min);
    const cv::v_float32x4 is_near = cv::v_absdiff(value, d) <= all(max_divergence_);
    const cv::v_float32x4 diverging = diverging_is_kept_ ? d : all(range_.invalid());
    return cv::v_select(is_allowed, cv::v_select(is_hole | is_near, value, diverging), d);
  }

  DisparityRange range_;
  float lowest_, highest_;  // To which a plane's value is moved.
  float min_value_, max_divergence_;
  bool diverging_is_kept_;
};

}  // namespace

void validate(const PlaneRefinementParameters& parameters) {
  const auto requirePositive = [](double value, const char* name) {
    requireArgument(value > 0.0 && std::isfinite(value), name, value, "greater than 0");
  };
  requirePositive(parameters.inlier_threshold, "inlier_threshold");
  const double confidence = parameters.confidence;
  requireArgument(confidence > 0.0 && confidence < 1.0, "confidence", confidence,
                  "greater than 0 and less than 1");
  requirePositive(parameters.max_slope_x, "max_slope_x");
  requirePositive(parameters.max_slope_y, "max_slope_y");
  const double disparity_error = parameters.disparity_error;
  requireArgument(disparity_error >= 0.0 && std::isfinite(disparity_error), "disparity_error",
                  disparity_error, "at least 0");
  requirePositive(parameters.max_depth_error, "max_depth_error");
  const double fraction = parameters.min_valid_fraction;
  requireArgument(fraction >= 0.0 && fraction <= 1.0, "min_valid_fraction", fraction, "0...1");
  requireArgument(parameters.min_valid_points >= 3, "min_valid_points", parameters.min_valid_points,
                  "at least 3");
  requireArgument(parameters.max_iterations >= 1, "max_iterations", parameters.max_iterations, "at least 1");
  const double divergence = parameters.max_divergence;
  requireArgument(divergence >= 0.0 && std::isfinite(divergence), "max_divergence", divergence, "at least 0");
  const auto on_divergence = parameters.divergence_action;
  requireArgument(on_divergence == DivergenceAction::KEEP || on_divergence == DivergenceAction::INVALIDATE ||
                      on_divergence == DivergenceAction::TAKE_PLANE,
                  "divergence_action", static_cast<int>(on_divergence),
                  "0 (keep), 1 (invalidate) or 2 (take plane)");
  const auto out_of_range = parameters.out_of_range_action;
  requireArgument(out_of_range == OutOfRangeAction::INVALIDATE || out_of_range == OutOfRangeAction::CLAMP,
                  "out_of_range_action", static_cast<int>(out_of_range), "0 (invalidate) or 1 (clamp)");
}

float smallestPlaneDisparity(const DisparityRange& range, double focal_length_times_baseline,
                             const PlaneRefinementParameters& parameters) {
  if (!(parameters.disparity_error > 0.0)) return range.min;
  const double depth_bound =
      std::sqrt(focal_length_times_baseline * parameters.disparity_error / parameters.max_depth_error);
  return std::max(range.min, roundedUp(depth_bound));
}

const char* toString(PlaneStatus status) {
  switch (status) {
    case PlaneStatus::ACCEPTED:
      return "accepted";
    case PlaneStatus::TOO_FEW_POINTS:
      return "too few points";
    case PlaneStatus::DEGENERATE:
      return "degenerate";
    case PlaneStatus::MAX_ITERATIONS:
      return "maximum number of iterations";
    case PlaneStatus::OF_NEIGHBOUR:
      return "of a neighbour";
  }
  return "unknown";
}

void PlaneRefinement::refine(const cv::Mat& disparity, const cv::Mat& labels, const DisparityRange& range,
                             double focal_length_times_baseline, const PlaneRefinementParameters& parameters,
                             cv::Mat& refined) {
  requireImage(disparity, "disparity", CV_32FC1);
  requireImage(labels, "labels", CV_32SC1, disparity.size());
  validate(range);
  requireArgument(focal_length_times_baseline > 0.0 && std::isfinite(focal_length_times_baseline),
                  "focal_length_times_baseline", focal_length_times_baseline, "greater than 0");
  validate(parameters);
  requireArgument(!overlap(refined, disparity), "refined", "the memory of disparity", "an image of its own");
  requireArgument(!overlap(refined, labels), "refined", "the memory of labels", "an image of its own");
  fitting_.setLabels(labels);

  copyValid(disparity, range, refined);
  const Reprojection reprojection(range, focal_length_times_baseline, parameters);
  fitting_.fit(refined, range, parameters, [&](int label, const SegmentPlane& plane, const SegmentPoints&) {
    if (plane.status != PlaneStatus::ACCEPTED) return;
    reprojection.apply(plane, fitting_.segments()[label], refined);
  });
  keepOneInvalid(refined, range);
}

}  // namespace disparity_refinement
