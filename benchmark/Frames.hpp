#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"

namespace disparity_refinement {

/// A stereo pair with what the default matcher and the default segmentation make of it.
struct Frame {
  cv::Mat left, right;
  cv::Mat disparity;  ///< CV_32FC1 [px]
  DisparityRange range;
  cv::Mat labels;                            ///< CV_32SC1
  double focal_length_times_baseline = 0.0;  ///< [px m]
};

/// What the benchmarks measure on: one synthetic street, or frames of KITTI.
struct FrameSet {
  std::vector<Frame> frames;

  double megapixels() const;
};

/// Number of disparities that is searched everywhere [px].
constexpr int DISPARITIES = 128;

/// Names of the sets: the sizes of the synthetic street by rising number of pixels and, if the environment
/// variable DISPARITY_REFINEMENT_KITTI names a KITTI `training` folder, "KITTI".
std::vector<std::string> frameSetNames();

/// The set, made when it is asked for first. Throws std::invalid_argument for another name.
const FrameSet& frameSet(const std::string& name);

}  // namespace disparity_refinement
