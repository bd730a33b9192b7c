#include "disparity_refinement/refinement/PlaneSmoothing.hpp"

#include <algorithm>
#include <cmath>

namespace disparity_refinement {
namespace {

// Weight of the plane as it was, as a share of that of all observations.
constexpr double INERTIA = 0.05;

// Where a segment lies: the mean of the middles of its runs, and half the side of a square about it.
struct Extent {
  double x = 0.0, y = 0.0, radius = 1.0;

  explicit Extent(RunSpan runs) {
    int n = 0;
    for (const Run& run : runs) {
      x += 0.5 * (run.x_begin + run.x_end);
      y += run.y;
      ++n;
    }
    if (n == 0) return;
    x /= n;
    y /= n;
    double largest = 0.0;
    for (const Run& run : runs) {
      largest = std::max({largest, std::abs(run.x_begin - x), std::abs(run.x_end - x), std::abs(run.y - y)});
    }
    radius = std::max(1.0, 0.5 * largest);
  }
};

// Normal equations of a plane, about a point near which the observations are.
class LeastSquares {
 public:
  LeastSquares(double origin_x, double origin_y) : origin_x_(origin_x), origin_y_(origin_y) {}

  void add(double x, double y, double d, double weight) {
    x -= origin_x_;
    y -= origin_y_;
    xx_ += weight * x * x;
    xy_ += weight * x * y;
    x_ += weight * x;
    yy_ += weight * y * y;
    y_ += weight * y;
    n_ += weight;
    xd_ += weight * x * d;
    yd_ += weight * y * d;
    d_ += weight * d;
  }

  double weight() const { return n_; }

  // The observations must not lie on a line.
  DisparityPlane solve() const {
    const double xx = xx_ - x_ * x_ / n_, xy = xy_ - x_ * y_ / n_, yy = yy_ - y_ * y_ / n_;
    const double xd = xd_ - x_ * d_ / n_, yd = yd_ - y_ * d_ / n_;
    const double determinant = xx * yy - xy * xy;
    DisparityPlane plane;
    plane.a = (xd * yy - yd * xy) / determinant;
    plane.b = (yd * xx - xd * xy) / determinant;
    plane.c = (d_ - plane.a * x_ - plane.b * y_) / n_ - plane.a * origin_x_ - plane.b * origin_y_;
    plane.is_known = std::isfinite(plane.a) && std::isfinite(plane.b) && std::isfinite(plane.c);
    return plane;
  }

 private:
  double origin_x_, origin_y_;
  double xx_ = 0.0, xy_ = 0.0, x_ = 0.0, yy_ = 0.0, y_ = 0.0, n_ = 0.0, xd_ = 0.0, yd_ = 0.0, d_ = 0.0;
};

}  // namespace

void smoothPlanes(const SegmentRuns& segments, const SegmentGraph& graph,
                  const std::vector<SegmentSupport>& support, const PlaneSmoothingParameters& parameters,
                  std::vector<DisparityPlane>& planes) {
  for (int sweep = 0; sweep < parameters.sweeps; ++sweep) {
    for (int segment = 0; segment < segments.size(); ++segment) {
      DisparityPlane& plane = planes[segment];
      if (!plane.is_known) continue;
      const Extent extent(segments[segment]);
      LeastSquares equations(extent.x, extent.y);
      const SegmentSupport& own = support[segment];
      for (int i = 0; i < own.size; ++i) {
        if (std::abs(plane.at(own.x[i], own.y[i]) - own.d[i]) > parameters.inlier_threshold) continue;
        equations.add(own.x[i], own.y[i], own.d[i], own.weight());
      }
      for (const SegmentGraph::Border& border : graph.bordersOf(segment)) {
        const DisparityPlane& neighbour = planes[border.neighbour];
        if (!neighbour.is_known) continue;
        const int stride = border.stride();
        const int samples = (border.length() + stride - 1) / stride;
        const double weight = parameters.border_weight * border.length() / samples;
        for (int i = border.first_point; i < border.end_point; i += stride) {
          const SegmentGraph::BorderPoint& point = graph.point(i);
          const double target = neighbour.at(point.x, point.y);
          const double step = (plane.at(point.x, point.y) - target) / parameters.max_step;
          if (std::abs(step) >= 1.0) continue;
          const double closeness = 1.0 - step * step;
          equations.add(point.x, point.y, target, weight * point.weight * closeness * closeness);
        }
      }
      const double inertia = INERTIA * (equations.weight() + 1.0) / 4.0;
      for (const double dx : {-extent.radius, extent.radius}) {
        for (const double dy : {-extent.radius, extent.radius}) {
          const double x = extent.x + dx, y = extent.y + dy;
          equations.add(x, y, plane.at(x, y), inertia);
        }
      }
      const DisparityPlane smoothed = equations.solve();
      if (smoothed.is_known) plane = smoothed;
    }
  }
}

}  // namespace disparity_refinement
