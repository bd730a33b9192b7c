#include "disparity_refinement/refinement/RefinementStatistics.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

/// Pixels of a segment with a plane at which a condition refuses it.
struct Refusals {
  int by_depth_error = 0, by_divergence = 0;
};

}  // namespace

RefinementStatistics measureRefinement(const cv::Mat& disparity, const cv::Mat& refined,
                                       const cv::Mat& labels, const DisparityRange& range,
                                       double focal_length_times_baseline,
                                       const RefinementParameters& parameters,
                                       const std::vector<SegmentPlane>& fitted) {
  requireImage(disparity, "disparity", CV_32FC1);
  requireImage(refined, "refined", CV_32FC1, disparity.size());
  requireImage(labels, "labels", CV_32SC1, disparity.size());
  double largest = 0.0;
  cv::minMaxLoc(labels, nullptr, &largest);
  requireArgument(largest < static_cast<double>(fitted.size()), "the largest label", largest,
                  "less than the number of planes, " + std::to_string(fitted.size()));

  const PlaneRefinementParameters& planes = parameters.planes;
  const float smallest = smallestPlaneDisparity(range, focal_length_times_baseline, planes);
  const bool is_clamped = planes.out_of_range_action == OutOfRangeAction::CLAMP;
  const bool is_divergence_bounded = planes.divergence_action != DivergenceAction::TAKE_PLANE;
  const bool is_per_pixel = parameters.mode == RefinementMode::PAPER;
  std::vector<Refusals> refusals(fitted.size());
  long valid_before = 0, valid_after = 0;
  for (int y = 0; y < disparity.rows; ++y) {
    const auto *d = disparity.ptr<float>(y), *r = refined.ptr<float>(y);
    const int* label = labels.ptr<int>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      const bool is_valid = range.isValid(d[x]);
      valid_before += is_valid ? 1 : 0;
      valid_after += range.isValid(r[x]) ? 1 : 0;
      if (!is_per_pixel || label[x] < 0 || fitted[label[x]].status != PlaneStatus::ACCEPTED) continue;
      const SegmentPlane& plane = fitted[label[x]];
      auto value = static_cast<float>(plane.a * x + (plane.b * y + plane.c));
      if (is_clamped) value = std::clamp(value, range.min, range.max);
      if (!(value >= smallest && value <= range.max)) {
        ++refusals[label[x]].by_depth_error;
      } else if (is_valid && is_divergence_bounded && std::abs(value - d[x]) > planes.max_divergence) {
        ++refusals[label[x]].by_divergence;
      }
    }
  }

  RefinementStatistics statistics;
  const auto pixels = static_cast<double>(disparity.total());
  statistics.valid_before = static_cast<double>(valid_before) / pixels;
  statistics.valid_after = static_cast<double>(valid_after) / pixels;
  for (std::size_t i = 0; i < fitted.size(); ++i) {
    const SegmentPlane& plane = fitted[i];
    if (plane.pixels == 0) continue;
    ++statistics.segments;
    statistics.too_few_points += plane.status == PlaneStatus::TOO_FEW_POINTS ? 1 : 0;
    statistics.degenerate += plane.status == PlaneStatus::DEGENERATE ? 1 : 0;
    statistics.max_iterations += plane.status == PlaneStatus::MAX_ITERATIONS ? 1 : 0;
    statistics.refused_by_depth_error += 2 * refusals[i].by_depth_error > plane.pixels ? 1 : 0;
    statistics.refused_by_divergence += 2 * refusals[i].by_divergence > plane.pixels ? 1 : 0;
  }
  return statistics;
}

}  // namespace disparity_refinement
