#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "disparity_refinement/DisparityRange.hpp"

namespace disparity_refinement {

/// One frame before and after the refinement. All images have the same size.
struct RefinementPicture {
  cv::Mat image;                                  ///< CV_8UC1 or CV_8UC3 (BGR), the left image
  cv::Mat labels;                                 ///< CV_32SC1
  cv::Mat disparity, refined;                     ///< CV_32FC1 [px]
  DisparityRange disparity_range, refined_range;  ///< What of them is valid.
  cv::Mat ground_truth;                           ///< CV_32FC1 [px], known where > 0; may be empty.
  float scale_max = 64.0F;                        ///< Disparity at the near end of the colour scale [px].
  std::string disparity_title = "disparity", refined_title = "refined disparity";
};

/// The paper's Figures 6 and 7 for one frame as one labelled picture, CV_8UC3: left image and segments;
/// disparity and refined disparity in one colour scale, with the share of valid pixels; with a ground truth
/// their errors too, with the share of pixels wrong by more than 3 px ("all" of KITTI's metric). Throws
/// std::invalid_argument if types or sizes do not fit.
cv::Mat drawRefinement(const RefinementPicture& frame);

}  // namespace disparity_refinement
