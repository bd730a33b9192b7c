#pragma once

#include <sensor_msgs/CameraInfo.h>

#include "disparity_refinement/StereoGeometry.hpp"

namespace disparity_refinement {

/// Geometry of the images as published: reads P alone, scaled by binning and shifted by the region of
/// interest; K and D may be empty. Throws std::invalid_argument like stereoGeometry of two projection
/// matrices.
StereoGeometry stereoGeometry(const sensor_msgs::CameraInfo& left, const sensor_msgs::CameraInfo& right);

}  // namespace disparity_refinement
