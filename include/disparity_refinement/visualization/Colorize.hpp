#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/PlaneRefinementParameters.hpp"

namespace disparity_refinement {

// Pictures for people. `bgr` becomes CV_8UC3 of the input's size and is written in place if it is that
// already. Images of another type, empty, or of different size throw std::invalid_argument.

/// A disparity map in the colours of cv::COLORMAP_TURBO, from blue at scale_min to red at scale_max [px], so
/// that near is warm. Values outside the scale take the colour of its nearer end; pixels without disparity
/// are black.
///
/// The scale is an argument and not the extent of the frame, so that the colours of two frames mean the same.
///
/// @param disparity  CV_32FC1 [px]; valid where finite and range.isValid.
/// @throws std::invalid_argument  unless scale_min < scale_max, both and their difference finite.
void colorizeDisparity(const cv::Mat& disparity, const DisparityRange& range, float scale_min,
                       float scale_max, cv::Mat& bgr);

/// Every label in a colour of its own, the same in each frame and far from that of the next label; negative
/// labels are black.
///
/// @param labels  CV_32SC1
void colorizeLabels(const cv::Mat& labels, cv::Mat& bgr);

/// The image with the pixels in `colour` whose label differs from that of the right or of the lower
/// neighbour.
///
/// @param image   CV_8UC1 or CV_8UC3 (BGR); may be `bgr` itself.
/// @param labels  CV_32SC1 of the same size.
/// @param colour  blue, green, red
void drawSegmentBorders(const cv::Mat& image, const cv::Mat& labels, cv::Mat& bgr,
                        const cv::Vec3b& colour = {0, 255, 255});

/// The colour of a segment whose plane was refused, blue, green, red: too few points orange, degenerate
/// magenta, maximum number of iterations red, of a neighbour blue. Black if it was accepted.
cv::Vec3b refusalColour(PlaneStatus status);

/// The image with every segment whose plane was refused half in its refusalColour, and segment borders
/// in light gray. Negative labels belong to no segment.
///
/// @param gray    CV_8UC1
/// @param labels  CV_32SC1 of the same size.
/// @param planes  Plane of every label; a label beyond them throws std::invalid_argument.
void drawRefusedSegments(const cv::Mat& gray, const cv::Mat& labels, const std::vector<SegmentPlane>& planes,
                         cv::Mat& bgr);

/// Absolute error of a disparity map: green up to 1 px, yellow up to 2 px, orange up to 3 px, red beyond.
/// Grey: the truth is known, but there is no disparity. Black: the truth is unknown.
///
/// @param disparity     CV_32FC1 [px]; valid where finite and range.isValid.
/// @param ground_truth  CV_32FC1 [px] of the same size; known where > 0.
void colorizeError(const cv::Mat& disparity, const DisparityRange& range, const cv::Mat& ground_truth,
                   cv::Mat& bgr);

}  // namespace disparity_refinement
