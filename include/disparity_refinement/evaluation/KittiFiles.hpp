#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/StereoGeometry.hpp"

namespace disparity_refinement {

/// Range of the disparities in a KITTI 16-bit PNG; 0, unknown, lies below it.
constexpr DisparityRange KITTI_PNG_RANGE{1.0F / 256.0F, 65535.0F / 256.0F};

/// A disparity map as a KITTI 16-bit PNG would give it back: 0 where invalid, other values rounded to the
/// nearest multiple of 1/256 px in KITTI_PNG_RANGE. Throws std::invalid_argument unless the map is CV_32FC1
/// and not empty.
cv::Mat roundToKittiPng(const cv::Mat& disparity, const DisparityRange& range);

/// Reads a KITTI 16-bit disparity PNG: CV_32FC1 [px], value / 256, 0 where unknown. Throws std::runtime_error
/// that names the file.
cv::Mat readDisparityPng(const std::string& path);

/// Writes a KITTI 16-bit disparity PNG with the values of roundToKittiPng. Throws std::runtime_error that
/// names the file if it cannot be written, and std::invalid_argument unless the map is CV_32FC1 and not
/// empty.
void writeDisparityPng(const std::string& path, const cv::Mat& disparity, const DisparityRange& range);

/// Reads the matrix of the first line that starts with `key` (for example "P0" or "P_rect_02") and a colon.
/// Throws std::runtime_error that names file and key if there is none or it does not hold exactly 12 numbers.
ProjectionMatrix readProjectionMatrix(const std::string& path, const std::string& key);

/// Read an image as CV_8UC1 or CV_8UC3 (BGR). Throw std::runtime_error that names the file.
cv::Mat readGrayImage(const std::string& path);
cv::Mat readColorImage(const std::string& path);

/// Throws std::runtime_error that names the file unless an image read from it has this size, that of the left
/// image.
void requireSizeOfLeftImage(const std::string& path, const cv::Mat& image, const cv::Size& left);

}  // namespace disparity_refinement
