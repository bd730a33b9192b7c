#include "disparity_refinement/ros/StereoGeometry.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace disparity_refinement {
namespace {

/// P of the image as published: binning and region of interest applied to the full-resolution matrix.
struct Projection {
  double fx, cx, tx;
};

bool isPositive(double value) { return value > 0.0 && std::isfinite(value); }

Projection projection(const sensor_msgs::CameraInfo& info) {
  const double binning = std::max<std::uint32_t>(1, info.binning_x);
  return {info.P[0] / binning, (info.P[2] - info.roi.x_offset) / binning, info.P[3] / binning};
}

}  // namespace

StereoGeometry stereoGeometry(const sensor_msgs::CameraInfo& left, const sensor_msgs::CameraInfo& right) {
  const Projection l = projection(left);
  const Projection r = projection(right);
  if (!isPositive(l.fx) || !isPositive(r.fx)) {
    std::ostringstream text;
    text << "the focal length P[0] is " << left.P[0] << " (left) and " << right.P[0]
         << " (right), expected positive values: are the cameras calibrated?";
    throw std::invalid_argument(text.str());
  }
  StereoGeometry geometry;
  geometry.focal_length = l.fx;
  geometry.baseline = (l.tx - r.tx) / l.fx;
  geometry.principal_point_offset = l.cx - r.cx;
  if (!isPositive(geometry.baseline)) {
    std::ostringstream text;
    text << "the baseline (P_left[3] - P_right[3]) / f = (" << left.P[3] << " - " << right.P[3] << ") / "
         << left.P[0] << " is not positive: P_right[3] should be -f * T; are left and right swapped?";
    throw std::invalid_argument(text.str());
  }
  if (!std::isfinite(geometry.principal_point_offset)) {
    std::ostringstream text;
    text << "the principal points P[2] are " << left.P[2] << " (left) and " << right.P[2]
         << " (right), expected finite values";
    throw std::invalid_argument(text.str());
  }
  return geometry;
}

}  // namespace disparity_refinement
