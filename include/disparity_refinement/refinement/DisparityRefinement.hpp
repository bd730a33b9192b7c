#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/PlaneRefinement.hpp"
#include "disparity_refinement/refinement/PlaneRefinementParameters.hpp"
#include "disparity_refinement/refinement/QualityRefinement.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {

/// Which refinement is made: the paper's (PlaneRefinement), or the one beyond it (QualityRefinement).
enum class RefinementMode { PAPER = 0, QUALITY = 1 };

/// The first of those segmentations whose planes help most beside one with (lambda, h) near (30, 3): finer
/// and coarser ones in turn.
///
/// @param number  0...MAX_FURTHER_SEGMENTATIONS
std::vector<SegmentationParameters> furtherSegmentations(int number);
constexpr int MAX_FURTHER_SEGMENTATIONS = 4;

struct RefinementParameters {
  RefinementMode mode = RefinementMode::PAPER;
  /// PAPER: everything. QUALITY: the fit.
  PlaneRefinementParameters planes;
  /// QUALITY alone.
  QualityParameters quality;
};

/// Throws std::invalid_argument that names the parameter, its value and what is expected.
void validate(const RefinementParameters& parameters);

/// The refinement in either mode. Its results are the same bits for any number of threads. Buffers are kept
/// between frames; one object serves one thread at a time.
class DisparityRefinement {
 public:
  /// @param disparity, labels, range, refined  See PlaneRefinement and QualityRefinement.
  /// @param gray                               CV_8UC1, the left image. Not looked at in mode PAPER.
  /// @param focal_length_times_baseline        f * T [px * m], > 0. Not looked at in mode QUALITY.
  /// @throws std::invalid_argument             For an unknown mode, and as the refinement that is made;
  ///                                           `refined` is not touched then.
  void refine(const cv::Mat& disparity, const cv::Mat& labels, const cv::Mat& gray,
              const DisparityRange& range, double focal_length_times_baseline,
              const RefinementParameters& parameters, cv::Mat& refined);

  /// Plane of every label that the last refine() used.
  std::vector<SegmentPlane> planes() const;

  /// The planes that were fitted to the segments; those of planes() in mode PAPER.
  const std::vector<SegmentPlane>& fittedPlanes() const {
    return mode_ == RefinementMode::PAPER ? paper_.planes() : quality_.fittedPlanes();
  }

 private:
  RefinementMode mode_ = RefinementMode::PAPER;
  PlaneRefinement paper_;
  QualityRefinement quality_;
};

}  // namespace disparity_refinement
