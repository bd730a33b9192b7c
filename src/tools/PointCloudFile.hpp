#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/StereoGeometry.hpp"

namespace disparity_refinement {

/// Writes every pixel with a disparity above 0 as a coloured point of a binary PLY file: x to the right, y
/// down, z forward from the left camera [m], Z = f * T / d.
///
/// @param disparity  CV_32FC1 [px], x_left - x_right without the offset of the principal points.
/// @param bgr        CV_8UC3 of the same size.
/// @param left       Projection matrix of the left image.
/// @return           The number of points.
/// Throws std::runtime_error that names the file, std::invalid_argument for images of another type or size.
int writePly(const std::string& file, const cv::Mat& disparity, const DisparityRange& range,
             const cv::Mat& bgr, const ProjectionMatrix& left, const StereoGeometry& geometry);

}  // namespace disparity_refinement
