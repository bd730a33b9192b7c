#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/SegmentGraph.hpp"
#include "disparity_refinement/refinement/SegmentPoints.hpp"
#include "disparity_refinement/refinement/SegmentRuns.hpp"
#include "disparity_refinement/refinement/SegmentSupport.hpp"

namespace disparity_refinement {

/// Segments with planes and what was measured: what the steps of the refinement beyond the paper work on.
struct PlaneScene {
  /// All labels 0, all gray values 100, no disparity.
  explicit PlaneScene(const cv::Size& size, const DisparityRange& disparity_range = {0.0F, 128.0F})
      : range(disparity_range),
        labels(size, CV_32SC1, cv::Scalar(0)),
        gray(size, CV_8UC1, cv::Scalar(100)),
        measured(size, CV_32FC1, cv::Scalar(disparity_range.invalid())) {}

  /// The value of a plane is measured in all pixels of a segment.
  void measure(int label, const DisparityPlane& plane) {
    for (int y = 0; y < labels.rows; ++y) {
      for (int x = 0; x < labels.cols; ++x) {
        if (labels.at<int>(y, x) == label) measured.at<float>(y, x) = static_cast<float>(plane.at(x, y));
      }
    }
  }

  /// To be called before a step, when the images are complete.
  void prepare(double half_contrast = 10.0) {
    segments.build(labels);
    graph.build(labels, gray, segments.size(), half_contrast);
    support.assign(segments.size(), {});
    planes.resize(segments.size());
    SegmentPoints points;
    for (int label = 0; label < segments.size(); ++label) {
      if (segments[label].begin() == segments[label].end()) continue;
      points.gather(measured, range, segments[label]);
      support[label].sample(points);
    }
  }

  DisparityRange range;
  cv::Mat labels, gray, measured;
  SegmentRuns segments;
  SegmentGraph graph;
  std::vector<SegmentSupport> support;
  std::vector<DisparityPlane> planes;  ///< None is known unless set.
};

}  // namespace disparity_refinement
