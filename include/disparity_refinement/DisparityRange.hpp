#pragma once

#include <limits>
#include <opencv2/core.hpp>

namespace disparity_refinement {

/// Closed interval of the valid disparities of a map [px].
///
/// A disparity map is a CV_32FC1 image, d = x_left - x_right. One value stands for "no disparity": min - 1,
/// the convention of stereo_msgs/DisparityImage.
struct DisparityRange {
  float min = 0.0F;
  float max = 128.0F;

  /// The value that marks a pixel without disparity.
  float invalid() const { return min - 1.0F; }

  /// False for the invalid value, for anything else below min, for infinity and NaN.
  bool isValid(float d) const { return d >= min && d <= std::numeric_limits<float>::max(); }
};

/// Throws std::invalid_argument that names range.min or range.max unless both are finite, max is at least
/// min, and the invalid value is less than min: from 2^24 on floats are too coarse for that.
void validate(const DisparityRange& range);

/// Copies a map; whatever is no disparity, NaN and infinity too, becomes range.invalid().
///
/// @param disparity  CV_32FC1.
/// @param copy       Another image; written in place if it has that type and size already.
void copyValid(const cv::Mat& disparity, const DisparityRange& range, cv::Mat& copy);

/// Marks the top left pixel invalid if every pixel of the map is valid.
///
/// cv::reprojectImageTo3D with handleMissingValues, and with it stereo_image_proc/point_cloud2, takes the
/// smallest value of a frame for "missing": a map without any hole would lose its farthest surface.
void keepOneInvalid(cv::Mat& disparity, const DisparityRange& range);

}  // namespace disparity_refinement
