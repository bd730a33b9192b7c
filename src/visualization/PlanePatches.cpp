#include "disparity_refinement/visualization/PlanePatches.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

bool hasPlane(const SegmentPlane& plane) {
  return plane.status == PlaneStatus::ACCEPTED || plane.status == PlaneStatus::OF_NEIGHBOUR;
}

/// Sums over the pixels of a segment.
struct Moments {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
};

std::vector<Moments> momentsOf(const cv::Mat& labels, std::size_t count) {
  std::vector<Moments> moments(count);
  for (int y = 0; y < labels.rows; ++y) {
    const int* row = labels.ptr<int>(y);
    for (int x = 0; x < labels.cols; ++x) {
      if (row[x] < 0) continue;
      Moments& m = moments[static_cast<std::size_t>(row[x])];
      m.n += 1.0;
      m.x += x;
      m.y += y;
      m.xx += static_cast<double>(x) * x;
      m.xy += static_cast<double>(x) * y;
      m.yy += static_cast<double>(y) * y;
    }
  }
  return moments;
}

/// Points around the origin on the ellipse x^T C^-1 x = 1, C the covariance of the pixels.
std::array<cv::Vec2d, PlanePatch::CORNERS> ellipseOf(const Moments& m) {
  // A pixel is a square of side 1, whose variance is 1 / 12.
  const double xx = m.xx / m.n - m.x * m.x / (m.n * m.n) + 1.0 / 12.0;
  const double xy = m.xy / m.n - m.x * m.y / (m.n * m.n);
  const double yy = m.yy / m.n - m.y * m.y / (m.n * m.n) + 1.0 / 12.0;
  // C = L L^T: L maps the circle to the ellipse.
  const double l00 = std::sqrt(xx), l10 = xy / l00, l11 = std::sqrt(std::max(0.0, yy - l10 * l10));
  std::array<cv::Vec2d, PlanePatch::CORNERS> corners;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const double angle = 2.0 * CV_PI * static_cast<double>(i) / PlanePatch::CORNERS;
    const double u = std::cos(angle), v = std::sin(angle);
    corners[i] = {l00 * u, l10 * u + l11 * v};
  }
  return corners;
}

/// The plane of a segment seen by a camera.
class PlaneInSpace {
 public:
  PlaneInSpace(const SegmentPlane& plane, const StereoGeometry& geometry, const cv::Point2d& principal_point)
      : plane_(plane), f_(geometry.focal_length), t_(geometry.baseline), c_(principal_point) {}

  cv::Vec3d normal() const {
    const cv::Vec3d away(plane_.a * f_, plane_.b * f_, plane_.a * c_.x + (plane_.b * c_.y + plane_.c));
    // The plane is away . P = f T > 0: away points from the camera to it.
    return -away / cv::norm(away);
  }

  /// The point seen at a pixel; none where the disparity is too small, or a coordinate too large.
  std::optional<cv::Point3d> point(double x, double y) const {
    const double d = plane_.a * x + (plane_.b * y + plane_.c);
    if (!(d >= MIN_PATCH_DISPARITY) || !std::isfinite(d)) return std::nullopt;
    const cv::Point3d point((x - c_.x) * t_ / d, (y - c_.y) * t_ / d, f_ * t_ / d);
    if (!std::isfinite(cv::norm(point))) return std::nullopt;
    return point;
  }

 private:
  const SegmentPlane& plane_;
  const double f_, t_;
  const cv::Point2d c_;
};

}  // namespace

std::vector<PlanePatch> findPlanePatches(const cv::Mat& labels, const std::vector<SegmentPlane>& planes,
                                         const StereoGeometry& geometry, const cv::Point2d& principal_point) {
  requireLabels(labels, labels.size(), planes.size());
  const std::vector<Moments> moments = momentsOf(labels, planes.size());
  std::vector<PlanePatch> patches;
  for (std::size_t label = 0; label < planes.size(); ++label) {
    const Moments& m = moments[label];
    if (!hasPlane(planes[label]) || m.n < MIN_PATCH_PIXELS) continue;
    const PlaneInSpace plane(planes[label], geometry, principal_point);
    const cv::Vec2d centroid(m.x / m.n, m.y / m.n);
    PlanePatch patch;
    patch.label = static_cast<int>(label);
    patch.normal = plane.normal();
    const auto put = [&plane](const cv::Vec2d& pixel, cv::Point3d& point) {
      const std::optional<cv::Point3d> seen = plane.point(pixel[0], pixel[1]);
      if (seen) point = *seen;
      return seen.has_value();
    };
    // Slopes of 1e200, as another node may publish them, leave no normal.
    bool is_seen = cv::norm(patch.normal) > 0.5 && put(centroid, patch.centre);
    const auto ellipse = ellipseOf(m);
    for (std::size_t i = 0; i < ellipse.size(); ++i) {
      is_seen = is_seen && put(centroid + ellipse[i], patch.corners[i]);
    }
    if (is_seen) patches.push_back(patch);
  }
  return patches;
}

cv::Vec3b normalColour(const cv::Vec3d& normal) {
  const cv::Vec3d size(std::abs(normal[2]), std::abs(normal[1]), std::abs(normal[0]));
  const double largest = std::max({size[0], size[1], size[2]});
  return largest > 0.0 ? cv::Vec3b(size * (255.0 / largest)) : cv::Vec3b();
}

}  // namespace disparity_refinement
