#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/PlaneRefinementParameters.hpp"
#include "disparity_refinement/refinement/SegmentPoints.hpp"
#include "disparity_refinement/refinement/SegmentRuns.hpp"

namespace disparity_refinement {

/// Fits a plane to the disparities of every segment; several threads work side by side.
///
/// The random numbers of a segment depend on its label alone: the result is the same for any number of
/// threads. Buffers are kept between frames; one object serves one thread at a time.
class PlaneFitting {
 public:
  /// @param labels  CV_32SC1, 0 ... n - 1; negative labels belong to no segment.
  /// @throws std::invalid_argument  for a label of at least the number of pixels; the former labels stay.
  void setLabels(const cv::Mat& labels) { segments_.build(labels); }

  /// @param disparity   CV_32FC1 [px] of the size of the labels, finite where range.isValid. A visitor may
  ///                    write to the pixels of its segment.
  /// @param parameters  Valid ones.
  /// @param visit       visit(int label, const SegmentPlane& plane, const SegmentPoints& points) is called
  ///                    after the fit of a segment by the thread that made it; other segments are at work
  ///                    meanwhile. The points are those of the segment if it has any pixel.
  template <typename Visitor>
  void fit(const cv::Mat& disparity, const DisparityRange& range, const PlaneRefinementParameters& parameters,
           const Visitor& visit) {
    // By reference: a function allocates memory for what it holds.
    fitAll(disparity, range, parameters, std::cref(visit));
  }

  /// Plane of every label.
  const std::vector<SegmentPlane>& planes() const { return planes_; }
  const SegmentRuns& segments() const { return segments_; }

 private:
  using Visit = std::function<void(int label, const SegmentPlane& plane, const SegmentPoints& points)>;

  void fitAll(const cv::Mat& disparity, const DisparityRange& range,
              const PlaneRefinementParameters& parameters, const Visit& visit);

  SegmentRuns segments_;
  std::vector<SegmentPoints> points_;  // Buffers of the strips of segments.
  std::vector<SegmentPlane> planes_;
};

}  // namespace disparity_refinement
