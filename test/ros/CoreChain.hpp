#pragma once

#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

#include "ChainClient.hpp"
#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

/// What the chain has to give: the same pair through the core.
namespace disparity_refinement {

struct CoreParameters {
  MatchingParameters matching;
  SegmentationParameters segmentation;
  RefinementParameters refinement;
};

struct CoreResult {
  DisparityRange range;
  cv::Mat disparity, labels, refined;
  int segments = 0;
  std::vector<SegmentPlane> planes, fitted_planes;
};

/// For a pair of mono8 images.
inline CoreResult runCore(const StereoMessages& messages, const CoreParameters& parameters) {
  const cv::Mat left = imageView(*messages.left, "mono8", "left");
  const cv::Mat right = imageView(*messages.right, "mono8", "right");

  CoreResult result;
  StereoMatcher matcher(parameters.matching);
  matcher.compute(left, right, result.disparity);
  result.range = matcher.range();
  Segmentation segmentation;
  result.segments = segmentation.compute(left, parameters.segmentation, result.labels);
  DisparityRefinement refinement;
  const double f_times_t = static_cast<double>(static_cast<float>(messages.left_info->P[0])) *
                           static_cast<float>(-messages.right_info->P[3] / messages.left_info->P[0]);
  refinement.refine(result.disparity, result.labels, left, result.range, f_times_t, parameters.refinement,
                    result.refined);
  result.planes = refinement.planes();
  result.fitted_planes = refinement.fittedPlanes();
  return result;
}

inline bool sameBits(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && a.isContinuous() && b.isContinuous() &&
         std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

}  // namespace disparity_refinement
