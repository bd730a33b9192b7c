#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {

void validate(const SegmentationParameters& parameters) {
  validate(parameters.connectivity);
  validateFilter(parameters.lambda, parameters.h);
  validate(parameters.gradient);
}

int Segmentation::compute(const cv::Mat& gray, const SegmentationParameters& parameters, cv::Mat& labels) {
  validate(parameters);
  gradient_.compute(gray, parameters.gradient, gradient_image_);
  tree_.build(gradient_image_, parameters.connectivity);
  tree_.filter(parameters.lambda, parameters.h, filtered_);
  return watershed_.compute(filtered_, parameters.connectivity, labels);
}

}  // namespace disparity_refinement
