#include "disparity_refinement/refinement/QualityRefinement.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/buffers.hpp"

namespace disparity_refinement {

void validate(const QualityParameters& p) {
  const auto requirePositive = [](double value, const char* name) {
    requireArgument(value > 0.0 && std::isfinite(value), name, value, "greater than 0");
  };
  const auto requireCost = [](double value, const char* name, double max) {
    if (!(value >= 0.0 && value <= max)) requireArgument(false, name, value, "0..." + std::to_string(max));
  };
  requirePositive(p.half_contrast, "half_contrast");
  requireArgument(p.selection.sweeps >= 0, "selection.sweeps", p.selection.sweeps, "at least 0");
  requirePositive(p.selection.data_truncation, "selection.data_truncation");
  requireCost(p.selection.border_weight, "selection.border_weight", 1e6);
  requirePositive(p.selection.border_truncation, "selection.border_truncation");
  requireArgument(p.smoothing.sweeps >= 0, "smoothing.sweeps", p.smoothing.sweeps, "at least 0");
  requirePositive(p.smoothing.inlier_threshold, "smoothing.inlier_threshold");
  requireCost(p.smoothing.border_weight, "smoothing.border_weight", 1e6);
  requirePositive(p.smoothing.max_step, "smoothing.max_step");
  // Bounds by 16-bit arithmetic: see PixelLabeling.cpp.
  requireCost(p.labeling.data_weight, "labeling.data_weight", 10.0);
  requirePositive(p.labeling.data_truncation, "labeling.data_truncation");
  requireCost(p.labeling.data_truncation, "labeling.data_truncation", 16.0);
  requireCost(p.labeling.data_weight * p.labeling.data_truncation, "labeling.data_weight * data_truncation",
              15.0);
  requireCost(p.labeling.edge_share, "labeling.edge_share", 1.0);
  requireArgument(p.labeling.edge_reach >= 0 && p.labeling.edge_reach <= 16, "labeling.edge_reach",
                  p.labeling.edge_reach, "0...16");
  requireCost(p.labeling.edge_step, "labeling.edge_step", 2048.0);
  requireCost(p.labeling.neighbour_cost, "labeling.neighbour_cost", 100.0);
  requireCost(p.labeling.neighbour_cost_in_hole, "labeling.neighbour_cost_in_hole", 100.0);
  requireCost(p.labeling.further_cost, "labeling.further_cost", 100.0);
  requireCost(p.labeling.further_cost_in_hole, "labeling.further_cost_in_hole", 100.0);
  requireCost(p.labeling.measured_cost, "labeling.measured_cost", 100.0);
  requireCost(p.labeling.visibility_cost, "labeling.visibility_cost", 100.0);
  requireCost(p.labeling.smoothness, "labeling.smoothness", 15.0);
  requirePositive(p.labeling.half_contrast, "labeling.half_contrast");
  requirePositive(p.labeling.step_truncation, "labeling.step_truncation");
  requireCost(p.labeling.step_truncation, "labeling.step_truncation", 16.0);
  requireCost(p.labeling.smoothness * p.labeling.step_truncation, "labeling.smoothness * step_truncation",
              15.0);
  requireCost(p.labeling.soft_reach, "labeling.soft_reach", 1000.0);
  requirePositive(p.labeling.half_cost, "labeling.half_cost");
  requireCost(p.labeling.half_cost, "labeling.half_cost", 100.0);
  requireArgument(p.further.size() <= 5, "number of further segmentations", p.further.size(), "at most 5");
  for (const SegmentationParameters& segmentation : p.further) validate(segmentation);
  requireArgument(p.medians >= 0, "medians", p.medians, "at least 0");
}

// The labels must be those of the fitting.
void QualityRefinement::Planes::find(const cv::Mat& measured, const cv::Mat& labels, const cv::Mat& gray,
                                     const DisparityRange& range, const PlaneRefinementParameters& fit,
                                     const QualityParameters& parameters) {
  const int segments = fitting.segments().size();
  growTo(support, segments);
  growTo(fitted, segments);
  fitted.resize(segments);
  fitting.fit(measured, range, fit, [&](int label, const SegmentPlane& plane, const SegmentPoints& points) {
    support[label].valid = support[label].size = 0;
    if (plane.pixels > 0) support[label].sample(points);
    fitted[label] = {plane.a, plane.b, plane.c, plane.status == PlaneStatus::ACCEPTED};
  });
  graph.build(labels, gray, segments, parameters.half_contrast);
  selectPlanes(graph, support, parameters.selection, fitted, chosen);
  smoothPlanes(fitting.segments(), graph, support, parameters.smoothing, chosen);
}

void QualityRefinement::findFurtherPlanes(const cv::Mat& gray, const DisparityRange& range,
                                          const PlaneRefinementParameters& fit,
                                          const QualityParameters& parameters) {
  further_.resize(std::max(further_.size(), parameters.further.size()));
  further_planes_.clear();
  for (std::size_t i = 0; i < parameters.further.size(); ++i) {
    Planes& planes = further_[i];
    segmentation_.compute(gray, parameters.further[i], planes.own_labels);
    planes.fitting.setLabels(planes.own_labels);
    planes.find(measured_, planes.own_labels, gray, range, fit, parameters);
    further_planes_.push_back({&planes.own_labels, &planes.chosen});
  }
}

void QualityRefinement::takePlanes(const DisparityRange& range, double max_divergence,
                                   cv::Mat& refined) const {
  const SegmentRuns& segments = planes_.fitting.segments();
  for (int label = 0; label < segments.size(); ++label) {
    const DisparityPlane& plane = planes_.chosen[label];
    if (!plane.is_known) continue;
    for (const Run& run : segments[label]) {
      float* row = refined.ptr<float>(run.y);
      for (int x = run.x_begin; x < run.x_end; ++x) {
        const float value = static_cast<float>(plane.at(x, run.y));
        if (range.isValid(row[x]) && std::abs(value - row[x]) > max_divergence) continue;
        row[x] = std::min(std::max(value, range.min), range.max);
      }
    }
  }
}

void QualityRefinement::refine(const cv::Mat& disparity, const cv::Mat& labels, const cv::Mat& gray,
                               const DisparityRange& range, const PlaneRefinementParameters& fit,
                               const QualityParameters& parameters, cv::Mat& refined) {
  requireImage(disparity, "disparity", CV_32FC1);
  requireImage(labels, "labels", CV_32SC1, disparity.size());
  requireImage(gray, "gray", CV_8UC1, disparity.size());
  validate(range);
  validate(fit);
  validate(parameters);
  for (const cv::Mat* input : {&disparity, &labels, &gray}) {
    requireArgument(!overlap(refined, *input), "refined", "the memory of an input", "an image of its own");
  }
  planes_.fitting.setLabels(labels);

  copyValid(disparity, range, measured_);
  planes_.find(measured_, labels, gray, range, fit, parameters);

  refined.create(disparity.size(), CV_32FC1);
  cv::Mat& chosen = parameters.medians > 0 ? chosen_ : refined;
  chosen.create(disparity.size(), CV_32FC1);
  if (parameters.label_pixels) {
    findFurtherPlanes(gray, range, fit, parameters);
    labeling_.compute(measured_, gray, range, planes_.fitting.segments(), planes_.graph, planes_.chosen,
                      further_planes_, parameters.labeling, chosen);
  } else {
    measured_.copyTo(chosen);
    takePlanes(range, fit.max_divergence, chosen);
  }
  // From one to the other and back; the last one is `refined`.
  for (int i = 0; i < parameters.medians; ++i) {
    const bool is_last = i + 1 == parameters.medians;
    cv::Mat& from = i % 2 == 0 ? chosen_ : measured_;
    cv::medianBlur(from, is_last ? refined : i % 2 == 0 ? measured_ : chosen_, 5);
  }
  keepOneInvalid(refined, range);
}

}  // namespace disparity_refinement
