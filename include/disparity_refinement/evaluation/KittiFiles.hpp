#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <string>

#include "disparity_refinement/DisparityRange.hpp"

namespace disparity_refinement {

/// Reads a KITTI 16-bit disparity PNG: CV_32FC1 [px], value / 256, 0 where unknown. Throws std::runtime_error
/// that names the file.
cv::Mat readDisparityPng(const std::string& path);

/// Writes a KITTI 16-bit disparity PNG: invalid pixels become 0, valid ones are rounded to the nearest
/// multiple of 1/256 px, at least 1/256 px and at most 65535/256 px. Throws std::runtime_error that names the
/// file if it cannot be written, and std::invalid_argument unless the map is CV_32FC1 and not empty.
void writeDisparityPng(const std::string& path, const cv::Mat& disparity, const DisparityRange& range);

/// 3x4 projection matrix, row major.
using ProjectionMatrix = std::array<double, 12>;

/// Reads the matrix of the first line that starts with `key` (for example "P0" or "P_rect_02") and a colon.
/// Throws std::runtime_error that names file and key if there is none or it does not hold exactly 12 numbers.
ProjectionMatrix readProjectionMatrix(const std::string& path, const std::string& key);

/// Reads an image as CV_8UC1. Throws std::runtime_error that names the file.
cv::Mat readGrayImage(const std::string& path);

}  // namespace disparity_refinement
