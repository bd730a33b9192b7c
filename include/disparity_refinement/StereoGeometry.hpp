#pragma once

#include <array>

namespace disparity_refinement {

/// 3x4 projection matrix of a rectified camera, row major: f = P[0], cx = P[2], cy = P[6]; P[3] = -f * T for
/// a camera that stands T to the right of the origin.
using ProjectionMatrix = std::array<double, 12>;

/// Geometry of a rectified stereo pair.
struct StereoGeometry {
  double focal_length = 0.0;            ///< f [px]
  double baseline = 0.0;                ///< T = (P_left[3] - P_right[3]) / f [m]
  double principal_point_offset = 0.0;  ///< cx_left - cx_right [px]; not 0 on a verged rig
};

/// Largest principal_point_offset, in size [px]: beyond it disparities in single precision are too coarse.
constexpr double MAX_PRINCIPAL_POINT_OFFSET = 1e6;

/// Throws std::invalid_argument that names the entries if f <= 0, T <= 0, or if the principal points are not
/// finite or too far apart.
StereoGeometry stereoGeometry(const ProjectionMatrix& left, const ProjectionMatrix& right);

}  // namespace disparity_refinement
