#include "disparity_refinement/ros/PlaneMarkers.hpp"

#include <boost/make_shared.hpp>

namespace disparity_refinement {
namespace {

using visualization_msgs::Marker;

constexpr float PATCH_OPACITY = 0.6F;
constexpr double NORMAL_LENGTH = 0.05;  // of the distance
constexpr double NORMAL_WIDTH_M = 0.03;

geometry_msgs::Point toMessage(const cv::Point3d& point) {
  geometry_msgs::Point message;
  message.x = point.x;
  message.y = point.y;
  message.z = point.z;
  return message;
}

std_msgs::ColorRGBA toMessage(const cv::Vec3b& bgr, float opacity) {
  std_msgs::ColorRGBA message;
  message.r = static_cast<float>(bgr[2]) / 255.0F;
  message.g = static_cast<float>(bgr[1]) / 255.0F;
  message.b = static_cast<float>(bgr[0]) / 255.0F;
  message.a = opacity;
  return message;
}

Marker makeMarker(const std_msgs::Header& header, const std::string& name, int type, bool is_empty) {
  Marker marker;
  marker.header = header;
  marker.ns = name;
  marker.type = type;
  marker.action = is_empty ? Marker::DELETE : Marker::ADD;
  marker.pose.orientation.w = 1.0;
  // rviz wants an opaque colour here though every corner has its own.
  marker.color.a = 1.0F;
  return marker;
}

void addPoint(Marker& marker, const cv::Point3d& point, const std_msgs::ColorRGBA& colour) {
  marker.points.push_back(toMessage(point));
  marker.colors.push_back(colour);
}

}  // namespace

visualization_msgs::MarkerArrayPtr planeMarkers(const std_msgs::Header& header,
                                                const std::vector<PlanePatch>& patches) {
  const auto message = boost::make_shared<visualization_msgs::MarkerArray>();
  message->markers = {makeMarker(header, "patches", Marker::TRIANGLE_LIST, patches.empty()),
                      makeMarker(header, "normals", Marker::LINE_LIST, patches.empty())};
  Marker& triangles = message->markers[0];
  Marker& lines = message->markers[1];
  triangles.scale.x = triangles.scale.y = triangles.scale.z = 1.0;
  lines.scale.x = NORMAL_WIDTH_M;
  for (const PlanePatch& patch : patches) {
    const cv::Vec3b bgr = normalColour(patch.normal);
    const std_msgs::ColorRGBA translucent = toMessage(bgr, PATCH_OPACITY);
    for (std::size_t i = 0; i < patch.corners.size(); ++i) {
      addPoint(triangles, patch.centre, translucent);
      addPoint(triangles, patch.corners[i], translucent);
      addPoint(triangles, patch.corners[(i + 1) % patch.corners.size()], translucent);
    }
    const cv::Point3d tip = patch.centre + cv::Point3d(NORMAL_LENGTH * cv::norm(patch.centre) * patch.normal);
    addPoint(lines, patch.centre, toMessage(bgr, 1.0F));
    addPoint(lines, tip, toMessage(bgr, 1.0F));
  }
  return message;
}

}  // namespace disparity_refinement
