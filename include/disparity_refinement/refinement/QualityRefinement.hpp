#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/PixelLabeling.hpp"
#include "disparity_refinement/refinement/PlaneFitting.hpp"
#include "disparity_refinement/refinement/PlaneRefinementParameters.hpp"
#include "disparity_refinement/refinement/PlaneSelection.hpp"
#include "disparity_refinement/refinement/PlaneSmoothing.hpp"
#include "disparity_refinement/refinement/SegmentGraph.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {

/// Parameters of QualityRefinement. Every step can be left out: selection and smoothing by 0 sweeps.
struct QualityParameters {
  /// Difference of gray values at which a border between segments counts half, > 0.
  double half_contrast = 10.0;
  PlaneSelectionParameters selection;
  PlaneSmoothingParameters smoothing;
  /// Whether pixels choose among candidates; otherwise a pixel takes its segment's plane, unless a measured
  /// disparity differs from it by more than the max_divergence of the fit.
  bool label_pixels = true;
  PixelLabelingParameters labeling;
  /// Further segmentations of the image, whose planes are candidates of the pixels too; each of them costs
  /// about as much time as a segmentation and half the refinement. At most 5.
  std::vector<SegmentationParameters> further;
  /// Times that the result is filtered by the median of 5 x 5 pixels, >= 0.
  int medians = 3;
};

/// Throws std::invalid_argument that names the parameter, its value and what is expected.
void validate(const QualityParameters& parameters);

/// A refinement beyond the paper, for a complete map: planes are fitted to the disparities of the segments as
/// there, then chosen among neighbours (selectPlanes), fitted to each other (smoothPlanes), and every pixel
/// chooses among the planes around it and what was measured (PixelLabeling).
///
/// The same bits for any number of threads. Buffers are kept between frames; one object serves one thread at
/// a time.
class QualityRefinement {
 public:
  /// @param disparity  CV_32FC1 [px]; valid where finite and range.isValid.
  /// @param labels     CV_32SC1 of the same size, 0 ... n - 1; a pixel with a negative label keeps its
  ///                   disparity.
  /// @param gray       CV_8UC1 of the same size: the left image.
  /// @param fit        What concerns the fit: inlier_threshold ... max_slope_y, min_valid_fraction,
  ///                   min_valid_points and max_iterations. The conditions 1 and 4 of the paper have no part
  ///                   here.
  /// @param refined    CV_32FC1 of the same size; written in place if it has that type and size already. At
  ///                   least one pixel is range.invalid(); otherwise only pixels without any plane around
  ///                   are.
  /// @throws std::invalid_argument  for images of another type, empty, or of different size, a label of at
  ///                   least the number of pixels, a `refined` that shares memory with an input, and bad
  ///                   parameters; `refined` is not touched then.
  void refine(const cv::Mat& disparity, const cv::Mat& labels, const cv::Mat& gray,
              const DisparityRange& range, const PlaneRefinementParameters& fit,
              const QualityParameters& parameters, cv::Mat& refined);

  /// Plane of every label of the last refine(): is_known is false where none could be found.
  const std::vector<DisparityPlane>& planes() const { return planes_.chosen; }
  /// The planes that were fitted to the segments, before any of them was exchanged or moved.
  const std::vector<SegmentPlane>& fittedPlanes() const { return planes_.fitting.planes(); }

 private:
  // A segmentation and its planes.
  struct Planes {
    void find(const cv::Mat& measured, const cv::Mat& labels, const cv::Mat& gray,
              const DisparityRange& range, const PlaneRefinementParameters& fit,
              const QualityParameters& parameters);

    cv::Mat own_labels;  // Of a further segmentation.
    PlaneFitting fitting;
    SegmentGraph graph;
    std::vector<SegmentSupport> support;
    std::vector<DisparityPlane> fitted, chosen;
  };

  void findFurtherPlanes(const cv::Mat& gray, const DisparityRange& range,
                         const PlaneRefinementParameters& fit, const QualityParameters& parameters);
  void takePlanes(const DisparityRange& range, double max_divergence, cv::Mat& refined) const;

  Planes planes_;
  Segmentation segmentation_;
  std::vector<Planes> further_;
  std::vector<FurtherPlanes> further_planes_;
  PixelLabeling labeling_;
  cv::Mat measured_, chosen_;
};

}  // namespace disparity_refinement
