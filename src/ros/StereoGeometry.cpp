#include "disparity_refinement/ros/StereoGeometry.hpp"

#include <algorithm>

namespace disparity_refinement {

ProjectionMatrix projectionMatrix(const sensor_msgs::CameraInfo& info) {
  ProjectionMatrix p{};
  std::copy(info.P.begin(), info.P.end(), p.begin());
  const double binning_x = std::max<std::uint32_t>(1, info.binning_x);
  const double binning_y = std::max<std::uint32_t>(1, info.binning_y);
  p[0] /= binning_x;
  p[2] = (p[2] - info.roi.x_offset) / binning_x;
  p[3] /= binning_x;
  p[5] /= binning_y;
  p[6] = (p[6] - info.roi.y_offset) / binning_y;
  p[7] /= binning_y;
  return p;
}

StereoGeometry stereoGeometry(const sensor_msgs::CameraInfo& left, const sensor_msgs::CameraInfo& right) {
  return stereoGeometry(projectionMatrix(left), projectionMatrix(right));
}

}  // namespace disparity_refinement
