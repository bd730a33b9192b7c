#pragma once

#include <std_msgs/Header.h>
#include <visualization_msgs/MarkerArray.h>

#include <vector>

#include "disparity_refinement/visualization/PlanePatches.hpp"

namespace disparity_refinement {

/// Two markers, so that rviz draws all planes of a frame at once and those of the next frame replace them:
/// "patches", triangles in the colour of the normal, and "normals", lines of a twentieth of the distance from
/// the centre towards the camera's side. Both are deleted if there is no patch.
visualization_msgs::MarkerArrayPtr planeMarkers(const std_msgs::Header& header,
                                                const std::vector<PlanePatch>& patches);

}  // namespace disparity_refinement
