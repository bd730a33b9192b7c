#include "disparity_refinement/refinement/DisparityRefinement.hpp"

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {

std::vector<SegmentationParameters> furtherSegmentations(int number) {
  requireArgument(number >= 0 && number <= MAX_FURTHER_SEGMENTATIONS, "further_segmentations", number,
                  "0...4");
  constexpr struct {
    int lambda, h;
  } SETTINGS[MAX_FURTHER_SEGMENTATIONS] = {{10, 3}, {80, 15}, {20, 4}, {50, 8}};
  std::vector<SegmentationParameters> segmentations(number);
  for (int i = 0; i < number; ++i) {
    segmentations[i].lambda = SETTINGS[i].lambda;
    segmentations[i].h = SETTINGS[i].h;
  }
  return segmentations;
}

namespace {

void validate(RefinementMode mode) {
  requireArgument(mode == RefinementMode::PAPER || mode == RefinementMode::QUALITY, "refinement_mode",
                  static_cast<int>(mode), "0 (paper) or 1 (quality)");
}

}  // namespace

void validate(const RefinementParameters& parameters) {
  validate(parameters.mode);
  validate(parameters.planes);
  validate(parameters.quality);
}

void DisparityRefinement::refine(const cv::Mat& disparity, const cv::Mat& labels, const cv::Mat& gray,
                                 const DisparityRange& range, double focal_length_times_baseline,
                                 const RefinementParameters& parameters, cv::Mat& refined) {
  validate(parameters.mode);
  if (parameters.mode == RefinementMode::PAPER) {
    paper_.refine(disparity, labels, range, focal_length_times_baseline, parameters.planes, refined);
  } else {
    quality_.refine(disparity, labels, gray, range, parameters.planes, parameters.quality, refined);
  }
  mode_ = parameters.mode;
}

std::vector<SegmentPlane> DisparityRefinement::planes() const {
  std::vector<SegmentPlane> planes = fittedPlanes();
  if (mode_ == RefinementMode::PAPER) return planes;
  for (std::size_t label = 0; label < planes.size(); ++label) {
    const DisparityPlane& used = quality_.planes()[label];
    if (!used.is_known) continue;
    SegmentPlane& plane = planes[label];
    plane.a = used.a;
    plane.b = used.b;
    plane.c = used.c;
    if (plane.status != PlaneStatus::ACCEPTED) plane.status = PlaneStatus::OF_NEIGHBOUR;
  }
  return planes;
}

}  // namespace disparity_refinement
