#include "disparity_refinement/refinement/PlaneRefinement.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/refinement/PlaneFit.hpp"

namespace disparity_refinement {
namespace {

// Whether the bytes from the first to the last pixel of two images meet.
bool overlap(const cv::Mat& a, const cv::Mat& b) {
  if (a.empty() || b.empty()) return false;
  const auto end = [](const cv::Mat& image) {
    return image.ptr(image.rows - 1) + image.cols * image.elemSize();
  };
  const std::less<const uchar*> before;
  return before(a.data, end(b)) && before(b.data, end(a));
}

// Copies a map. Whatever is no disparity, NaN and infinity too, becomes range.invalid().
void copyValid(const cv::Mat& disparity, const DisparityRange range, cv::Mat& copy) {
  for (int y = 0; y < disparity.rows; ++y) {
    const float* from = disparity.ptr<float>(y);
    float* to = copy.ptr<float>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      to[x] = range.isValid(from[x]) ? from[x] : range.invalid();
    }
  }
}

// Writes a plane back where conditions 1 and 4, which are decided per pixel, hold.
class Reprojection {
 public:
  Reprojection(const DisparityRange& range, double focal_length_times_baseline,
               const PlaneRefinementParameters& parameters)
      : range_(range),
        clamp_(parameters.out_of_range_action == OutOfRangeAction::CLAMP),
        min_value_(range.min),
        max_divergence_(parameters.max_divergence),
        diverging_is_kept_(parameters.divergence_action == DivergenceAction::KEEP) {
    if (parameters.disparity_error > 0.0) {
      const double depth_bound =
          std::sqrt(focal_length_times_baseline * parameters.disparity_error / parameters.max_depth_error);
      min_value_ = std::max(min_value_, depth_bound);
    }
    if (parameters.divergence_action == DivergenceAction::TAKE_PLANE) {
      max_divergence_ = std::numeric_limits<double>::infinity();
    }
  }

  void apply(const SegmentPlane& plane, RunSpan runs, cv::Mat& disparity) const {
    const Reprojection reproject = *this;  // A local copy stays in registers.
    const double a = plane.a;
    for (const Run& run : runs) {
      float* row = disparity.ptr<float>(run.y);
      const double start = plane.b * run.y + plane.c;
      for (int x = run.x_begin; x < run.x_end; ++x) {
        row[x] = reproject.refined(row[x], static_cast<float>(a * x + start));
      }
    }
  }

 private:
  // What becomes of a pixel of disparity d where the plane is at `value`.
  float refined(float d, float value) const {
    if (clamp_) value = std::min(std::max(value, range_.min), range_.max);
    if (!(value >= min_value_ && value <= range_.max)) return d;
    if (!range_.isValid(d) || std::abs(static_cast<double>(value) - d) <= max_divergence_) return value;
    return diverging_is_kept_ ? d : range_.invalid();
  }

  DisparityRange range_;
  bool clamp_;
  double min_value_, max_divergence_;
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
  }
  return "unknown";
}

void PlaneRefinement::refine(const cv::Mat& disparity, const cv::Mat& labels, const DisparityRange& range,
                             double focal_length_times_baseline, const PlaneRefinementParameters& parameters,
                             cv::Mat& refined) {
  requireImage(disparity, "disparity", CV_32FC1);
  requireImage(labels, "labels", CV_32SC1, disparity.size());
  requireArgument(std::isfinite(range.min), "range.min", range.min, "a finite number");
  requireArgument(std::isfinite(range.max) && range.max >= range.min, "range.max", range.max,
                  "a finite number, at least range.min, " + std::to_string(range.min));
  requireArgument(focal_length_times_baseline > 0.0 && std::isfinite(focal_length_times_baseline),
                  "focal_length_times_baseline", focal_length_times_baseline, "greater than 0");
  validate(parameters);
  requireArgument(!overlap(refined, disparity), "refined", "the memory of disparity", "an image of its own");
  requireArgument(!overlap(refined, labels), "refined", "the memory of labels", "an image of its own");
  segments_.build(labels);

  refined.create(disparity.size(), CV_32FC1);
  copyValid(disparity, range, refined);
  planes_.assign(segments_.size(), SegmentPlane());
  const Reprojection reprojection(range, focal_length_times_baseline, parameters);
  cv::parallel_for_(cv::Range(0, segments_.size()), [&](const cv::Range& part) {
    for (int label = part.start; label < part.end; ++label) {
      const RunSpan runs = segments_[label];
      SegmentPlane& plane = planes_[label];
      plane = fitPlane(refined, range, runs, static_cast<std::uint64_t>(label), parameters);
      if (plane.status == PlaneStatus::ACCEPTED) reprojection.apply(plane, runs, refined);
    }
  });
  keepOneInvalid(refined, range);
}

}  // namespace disparity_refinement
