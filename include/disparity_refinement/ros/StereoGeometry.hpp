#pragma once

#include <sensor_msgs/CameraInfo.h>

#include "disparity_refinement/StereoGeometry.hpp"

namespace disparity_refinement {

/// P of the image as published: scaled by binning and shifted by the region of interest.
ProjectionMatrix projectionMatrix(const sensor_msgs::CameraInfo& info);

/// Geometry of the images as published: reads P alone; K and D may be empty. Throws std::invalid_argument
/// like stereoGeometry of two projection matrices.
StereoGeometry stereoGeometry(const sensor_msgs::CameraInfo& left, const sensor_msgs::CameraInfo& right);

}  // namespace disparity_refinement
