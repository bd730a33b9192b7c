#pragma once

#include <gtest/gtest.h>
#include <sensor_msgs/image_encodings.h>
#include <stereo_msgs/DisparityImage.h>

#include <cstdint>
#include <opencv2/core.hpp>

#include "disparity_refinement/ros/Messages.hpp"

namespace disparity_refinement {

/// What consumers rely on, whatever came in: one invalid value, all others inside the range.
inline void expectContract(const stereo_msgs::DisparityImage& message) {
  EXPECT_GT(message.f, 0.0F);
  EXPECT_GT(message.T, 0.0F);
  EXPECT_GT(message.delta_d, 0.0F);
  EXPECT_GT(message.valid_window.width, 0U);
  EXPECT_GT(message.valid_window.height, 0U);
  EXPECT_LE(std::uint64_t{message.valid_window.x_offset} + message.valid_window.width, message.image.width);
  EXPECT_LE(std::uint64_t{message.valid_window.y_offset} + message.valid_window.height, message.image.height);
  const cv::Mat map = imageView(message.image, sensor_msgs::image_encodings::TYPE_32FC1, "disparity_refined");
  int invalid = 0;
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      const float d = map.at<float>(y, x);
      if (d == message.min_disparity - 1.0F) {
        ++invalid;
      } else {
        ASSERT_TRUE(d >= message.min_disparity && d <= message.max_disparity)
            << d << " at " << x << ", " << y;
      }
    }
  }
  EXPECT_GT(invalid, 0);
}

}  // namespace disparity_refinement
