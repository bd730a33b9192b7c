#include "disparity_refinement/segmentation/Segmentation.hpp"

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {

void validate(const SegmentationParameters& parameters) {
  validate(parameters.connectivity);
  validateFilter(parameters.lambda, parameters.h);
  validate(parameters.gradient);
}

Segmentation::Segmentation(int strips) : strips_(strips), watershed_(strips) {}

int Segmentation::compute(const cv::Mat& gray, const SegmentationParameters& parameters, cv::Mat& labels) {
  computeGradient(gray, parameters);
  return watershed_.compute(parameters.lambda, parameters.h, parameters.connectivity, labels);
}

cv::Mat Segmentation::countSurface(const cv::Mat& gray, const SegmentationParameters& parameters,
                                   int max_lambda, int max_h) {
  computeGradient(gray, parameters);
  return watershed_.countSurface(max_lambda, max_h, parameters.connectivity);
}

void Segmentation::computeGradient(const cv::Mat& gray, const SegmentationParameters& parameters) {
  validate(parameters);
  requireImage(gray, "gray", CV_8UC1);
  cv::Mat image = watershed_.image(gray.size());
  gradient_.compute(gray, parameters.gradient, image, strips_);
}

}  // namespace disparity_refinement
