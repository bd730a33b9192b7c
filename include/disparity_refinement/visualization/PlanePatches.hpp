#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/StereoGeometry.hpp"
#include "disparity_refinement/refinement/PlaneRefinementParameters.hpp"

namespace disparity_refinement {

/// What a segment shows of its plane, in the optical frame of the left camera: x right, y down, z forward
/// [m].
///
/// With x = f X / Z + cx, y = f Y / Z + cy and d = f T / Z, the plane d = a x + b y + c of the image is
/// a f X + b f Y + (a cx + b cy + c) Z = f T in space.
struct PlanePatch {
  static constexpr int CORNERS = 16;

  int label = 0;
  cv::Point3d centre;  ///< Of the plane, at the centroid of the segment's pixels.
  cv::Vec3d normal;    ///< Of length 1, to the side of the camera.
  /// Of the plane, around the centre: an ellipse in the image with the directions and the proportions of the
  /// segment's second moments, and half the segment's extent.
  std::array<cv::Point3d, CORNERS> corners;
};

/// The patch of every segment with a plane, its own or a neighbour's, in order of the labels. Segments of
/// less than MIN_PATCH_PIXELS are left out, and patches of which a corner has a disparity below
/// MIN_PATCH_DISPARITY: they would hide the others, or reach beyond the horizon. So are planes so steep or so
/// far that they are not finite in space: rviz would refuse all.
///
/// @param labels           CV_32SC1, 0 ... planes.size() - 1; negative labels belong to no segment.
/// @param planes           Plane of every label.
/// @param geometry         f > 0 and T > 0.
/// @param principal_point  (cx, cy) of the left image [px].
/// @throws std::invalid_argument  for labels of another type, empty, or at least planes.size().
std::vector<PlanePatch> findPlanePatches(const cv::Mat& labels, const std::vector<SegmentPlane>& planes,
                                         const StereoGeometry& geometry, const cv::Point2d& principal_point);

constexpr int MIN_PATCH_PIXELS = 100;
constexpr double MIN_PATCH_DISPARITY = 1.0;  ///< [px]

/// The colour of a normal, blue, green, red: red where it is along x (walls beside the camera), green along y
/// (the road), blue along z (what faces the camera), whatever the side, and mixtures; the largest is 255.
cv::Vec3b normalColour(const cv::Vec3d& normal);

}  // namespace disparity_refinement
