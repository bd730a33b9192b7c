#pragma once

#include <sensor_msgs/CameraInfo.h>

namespace disparity_refinement {

/// Geometry of a rectified stereo pair, from the projection matrices of its two CameraInfos.
struct StereoGeometry {
  double focal_length = 0.0;            ///< f [px]
  double baseline = 0.0;                ///< T = (P_left[3] - P_right[3]) / f [m]
  double principal_point_offset = 0.0;  ///< cx_left - cx_right [px]; not 0 on a verged rig
};

/// Reads P alone, scaled by binning and shifted by the region of interest; K and D may be empty. Throws
/// std::invalid_argument that names the entries if f <= 0 or T <= 0.
StereoGeometry stereoGeometry(const sensor_msgs::CameraInfo& left, const sensor_msgs::CameraInfo& right);

}  // namespace disparity_refinement
