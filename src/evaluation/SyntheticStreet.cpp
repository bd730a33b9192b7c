#include "disparity_refinement/evaluation/SyntheticStreet.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/core/utility.hpp>
#include <vector>

#include "StreetScene.hpp"
#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

using street::Solid;
using street::Vec;

constexpr double CAMERA_SPEED = 8.0;  // [m/s]
constexpr double NEAREST = 1.0;       // nothing is seen from nearer than this [m]
constexpr double INF = std::numeric_limits<double>::infinity();

// A low sun from behind on the left, and so little light from the sky that road and walls have gray values of
// 50 and less in the shadow.
constexpr double SUN_BRIGHTNESS = 1.15;
constexpr double SKY_BRIGHTNESS = 0.24;
const Vec TO_SUN = Vec(-0.60, -0.70, -0.39) / std::sqrt(0.60 * 0.60 + 0.70 * 0.70 + 0.39 * 0.39);

// Positions of the samples inside a pixel: a grid rotated such that edges along x and y meet four different
// steps.
constexpr std::array<std::array<double, 2>, 4> SAMPLES = {
    {{-0.375, -0.125}, {0.125, -0.375}, {0.375, 0.125}, {-0.125, 0.375}}};

struct Ray {
  Ray(const Vec& ray_origin, const Vec& ray_direction)
      : origin(ray_origin), direction(ray_direction), inverse(ray_direction.cwiseInverse()) {}

  Vec at(double t) const { return origin + t * direction; }

  Vec origin, direction;
  Vec inverse;  // of the direction, element by element
};

/// Part of a ray inside a solid, from `enter` to `exit` in units of its direction; empty if exit < enter.
struct Interval {
  double enter = -INF, exit = INF;
  int entered_face = 0;  // of a box: 0, 1, 2 for a side across x, y, z, 3... for a cut

  bool isEmpty() const { return exit < enter; }

  void clip(double from, double to, int face) {
    if (from > enter) {
      enter = from;
      entered_face = face;
    }
    exit = std::min(exit, to);
  }
};

constexpr int FIRST_CUT = 3;

Interval intersectBox(const Solid& solid, const Ray& ray) {
  Interval inside;
  for (int k = 0; k < 3; ++k) {
    const double low = (solid.low[k] - ray.origin[k]) * ray.inverse[k];
    const double high = (solid.high[k] - ray.origin[k]) * ray.inverse[k];
    inside.clip(std::min(low, high), std::max(low, high), k);
    if (inside.isEmpty()) {
      return inside;
    }
  }
  int face = FIRST_CUT;
  for (const street::HalfSpace& cut : solid.cuts) {
    const double slope = cut.normal.dot(ray.direction);
    const double t = (cut.offset - cut.normal.dot(ray.origin)) / slope;
    inside.clip(slope < 0.0 ? t : -INF, slope < 0.0 ? INF : t, face++);
  }
  return inside;
}

Interval intersectEllipsoid(const Solid& solid, const Ray& ray) {
  const Vec scale = solid.radii().cwiseInverse();
  const Vec o = (ray.origin - solid.centre()).cwiseProduct(scale);
  const Vec v = ray.direction.cwiseProduct(scale);
  const double a = v.dot(v), b = o.dot(v), discriminant = b * b - a * (o.dot(o) - 1.0);
  Interval inside;
  if (discriminant < 0.0) {
    inside.exit = -INF;
  } else {
    const double root = std::sqrt(discriminant);
    inside.enter = (-b - root) / a;
    inside.exit = (-b + root) / a;
  }
  return inside;
}

Interval intersect(const Solid& solid, const Ray& ray) {
  return solid.ellipsoid ? intersectEllipsoid(solid, ray) : intersectBox(solid, ray);
}

/// Outward normal of a solid where the ray enters it.
Vec normalAt(const Solid& solid, const Ray& ray, const Interval& inside) {
  if (solid.ellipsoid) {
    const Vec radii = solid.radii();
    return (ray.at(inside.enter) - solid.centre()).cwiseQuotient(radii.cwiseProduct(radii)).normalized();
  }
  if (inside.entered_face >= FIRST_CUT) {
    return solid.cuts[inside.entered_face - FIRST_CUT].normal;
  }
  const int axis = inside.entered_face;
  return ray.direction[axis] > 0.0 ? Vec(-Vec::Unit(axis)) : Vec(Vec::Unit(axis));
}

/// Lists the solids that a ray may meet. The rays of one family, all through one camera or all parallel to
/// the sun's, are the points of a plane; a solid stands in the cells of that plane which the image of its box
/// touches.
class RayIndex {
 public:
  /// @param extent  Where the rays are dense; whatever lies outside counts to the nearest cell.
  RayIndex(const cv::Rect2d& extent, double cell)
      : origin_(extent.tl()),
        cell_(cell),
        columns_(static_cast<int>(extent.width / cell) + 1),
        rows_(static_cast<int>(extent.height / cell) + 1),
        cells_(static_cast<std::size_t>(columns_) * rows_) {}

  /// @param low, high  Opposite corners of the solid's box, or of the part of it that matters.
  /// @param project    Maps a world point to the plane.
  template <typename Project>
  void add(const Solid& solid, const Vec& low, const Vec& high, const Project& project) {
    cv::Point2d first(INF, INF), last(-INF, -INF);
    for (unsigned corner = 0; corner < 8; ++corner) {
      const cv::Point2d p =
          project(Vec((corner & 1U) != 0 ? high.x() : low.x(), (corner & 2U) != 0 ? high.y() : low.y(),
                      (corner & 4U) != 0 ? high.z() : low.z()));
      first = {std::min(first.x, p.x), std::min(first.y, p.y)};
      last = {std::max(last.x, p.x), std::max(last.y, p.y)};
    }
    for (int r = row(first.y); r <= row(last.y); ++r) {
      for (int c = column(first.x); c <= column(last.x); ++c) {
        cells_[static_cast<std::size_t>(r) * columns_ + c].push_back(&solid);
      }
    }
  }

  /// In the order in which they were added.
  const std::vector<const Solid*>& at(const cv::Point2d& p) const {
    return cells_[static_cast<std::size_t>(row(p.y)) * columns_ + column(p.x)];
  }

 private:
  int column(double x) const { return clampedCell(x - origin_.x, columns_); }
  int row(double y) const { return clampedCell(y - origin_.y, rows_); }
  int clampedCell(double distance, int count) const {
    return static_cast<int>(std::clamp(distance / cell_, 0.0, count - 1.0));
  }

  cv::Point2d origin_;
  double cell_;
  int columns_, rows_;
  std::vector<std::vector<const Solid*>> cells_;
};

/// What a ray meets first.
struct Hit {
  double depth;  // along z [m]
  Vec point;
  Vec normal;
  const Solid* solid;  // none: the road or the backdrop
};

/// The street at one moment, seen by two cameras.
class Scene {
 public:
  Scene(const StreetParameters& parameters, const cv::Point2d& principal_point, int frame)
      : parameters_(parameters),
        principal_point_(principal_point),
        z_(CAMERA_SPEED * frame / SyntheticStreet::FRAME_RATE),
        solids_(street::layOut(parameters.seed, z_, frame / SyntheticStreet::FRAME_RATE)),
        left_(imageExtent(parameters), 16.0),
        right_(imageExtent(parameters), 16.0),
        sun_({-40.0, z_, 80.0, street::BACKDROP_DISTANCE}, 2.0) {
    // Sorted, so that the search for the nearest hit can stop early.
    std::stable_sort(solids_.begin(), solids_.end(),
                     [](const Solid& a, const Solid& b) { return a.low.z() < b.low.z(); });
    for (const Solid& solid : solids_) {
      if (solid.high.z() > z_ + NEAREST) {
        const Vec low(solid.low.x(), solid.low.y(), std::max(solid.low.z(), z_ + NEAREST));
        left_.add(solid, low, solid.high, [this](const Vec& p) { return project(p, 0.0); });
        right_.add(solid, low, solid.high, [this](const Vec& p) { return project(p, parameters_.baseline); });
      }
      sun_.add(solid, solid.low, solid.high, projectAlongSun);
    }
  }
  // The indices point to the solids.
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// @param camera_x  0: left camera, baseline: right camera.
  /// @param x, y      Position in its image [px].
  Hit cast(double camera_x, double x, double y) const {
    const Ray ray({camera_x, 0.0, z_}, {(x - principal_point_.x) / parameters_.focal_length,
                                        (y - principal_point_.y) / parameters_.focal_length, 1.0});
    double depth = street::BACKDROP_DISTANCE;
    Vec normal = -Vec::UnitZ();
    const double road_depth = SyntheticStreet::CAMERA_HEIGHT * ray.inverse.y();
    if (road_depth > 0.0 && road_depth < depth) {
      depth = road_depth;
      normal = -Vec::UnitY();
    }
    const Solid* nearest = nullptr;
    Interval nearest_inside;
    for (const Solid* solid : (camera_x == 0.0 ? left_ : right_).at({x, y})) {
      if (solid->low.z() - z_ > depth) {
        break;
      }
      const Interval inside = intersect(*solid, ray);
      if (!inside.isEmpty() && inside.enter > 0.0 && inside.enter < depth) {
        depth = inside.enter;
        nearest = solid;
        nearest_inside = inside;
      }
    }
    if (nearest != nullptr) {
      normal = normalAt(*nearest, ray, nearest_inside);
    }
    return {depth, ray.at(depth), normal, nearest};
  }

  /// Whether the right camera sees what the left camera does at column x, row y.
  bool isSeenByRight(const Hit& hit, double x, double y) const {
    const double right_x = x - parameters_.focal_length * parameters_.baseline / hit.depth;
    // Half a millimetre tells the same surface from one in front of it.
    return right_x >= 0.0 && cast(parameters_.baseline, right_x, y).depth > hit.depth - 5e-4;
  }

  /// Brightness, 0...1.
  double shade(const Hit& hit, double camera_x) const {
    const Vec from_camera = hit.point - Vec(camera_x, 0.0, z_);
    if (hit.depth >= street::BACKDROP_DISTANCE) {
      return street::backdropBrightness(hit.point - Vec(0.0, 0.0, z_), parameters_.seed);
    }
    // How far the point moves on the surface from one pixel of the row to the next. Both images have the same
    // rows, so only along them must the texture be free of detail smaller than a pixel.
    const Vec view = from_camera / hit.depth;
    const Vec step = Vec::UnitX() - hit.normal.x() / hit.normal.dot(view) * view;
    const double pixel_size = hit.depth / parameters_.focal_length * std::sqrt(step.dot(step));
    Vec normal = hit.normal;
    double albedo = 0.0;
    if (hit.solid == nullptr) {
      albedo = street::roadAlbedo(hit.point, pixel_size, parameters_.seed);
    } else {
      albedo = street::albedo(*hit.solid, hit.point, hit.normal, pixel_size);
      if (hit.solid->material == street::Material::CAR_BODY ||
          hit.solid->material == street::Material::CAR_CABIN) {
        // Sheet metal is bent: the light changes smoothly over a face.
        normal =
            (normal + 0.5 * (hit.point - hit.solid->centre()).cwiseQuotient(hit.solid->radii())).normalized();
      }
    }
    const double sun = isInSun(hit) ? SUN_BRIGHTNESS * std::max(0.0, normal.dot(TO_SUN)) : 0.0;
    const double sky = SKY_BRIGHTNESS * (0.8 - 0.2 * normal.y());
    const double haze = hit.depth / (hit.depth + 1500.0);
    return (1.0 - haze) * albedo * (sun + sky) + haze * 0.8;
  }

 private:
  static cv::Rect2d imageExtent(const StreetParameters& parameters) {
    return {0.0, 0.0, static_cast<double>(parameters.width), static_cast<double>(parameters.height)};
  }

  cv::Point2d project(const Vec& p, double camera_x) const {
    const double scale = parameters_.focal_length / (p.z() - z_);
    return {principal_point_.x + scale * (p.x() - camera_x), principal_point_.y + scale * p.y()};
  }

  /// Onto the road, as (x, z).
  static cv::Point2d projectAlongSun(const Vec& p) {
    const double steps = (SyntheticStreet::CAMERA_HEIGHT - p.y()) / TO_SUN.y();
    return {p.x() + steps * TO_SUN.x(), p.z() + steps * TO_SUN.z()};
  }

  bool isInSun(const Hit& hit) const {
    if (hit.normal.dot(TO_SUN) <= 0.0) {
      return false;
    }
    const Ray ray(hit.point, TO_SUN);
    for (const Solid* solid : sun_.at(projectAlongSun(hit.point))) {
      const Interval inside = intersect(*solid, ray);
      // A ray that leaves a surface touches it over a tiny interval.
      if (!inside.isEmpty() && inside.exit > 1e-6) {
        return false;
      }
    }
    return true;
  }

  const StreetParameters& parameters_;
  cv::Point2d principal_point_;
  double z_;  // of the cameras
  std::vector<Solid> solids_;
  RayIndex left_, right_, sun_;
};

/// Approximately normal noise of standard deviation 1: the sum of four uniform 16-bit numbers.
double standardNoise(std::uint64_t random_bits) {
  std::int64_t sum = 0;
  for (int shift = 0; shift < 64; shift += 16) {
    sum += static_cast<std::int64_t>((random_bits >> static_cast<unsigned>(shift)) & 0xffffU);
  }
  const double variance_of_sum = 4.0 * 65536.0 * 65536.0 / 12.0;
  return (static_cast<double>(sum) - 4.0 * 32767.5) / std::sqrt(variance_of_sum);
}

}  // namespace

SyntheticStreet::SyntheticStreet(const StreetParameters& parameters) : parameters_(parameters) {
  requireArgument(parameters.width >= 64, "width", parameters.width, "at least 64");
  requireArgument(parameters.height >= 48, "height", parameters.height, "at least 48");
  const double focal_length = parameters.focal_length, baseline = parameters.baseline,
               noise = parameters.noise;
  requireArgument(focal_length > 0.0 && std::isfinite(focal_length), "focal_length", focal_length,
                  "a positive number");
  requireArgument(baseline > 0.0 && std::isfinite(baseline), "baseline", baseline, "a positive number");
  requireArgument(noise >= 0.0 && std::isfinite(noise), "noise", noise, "at least 0");
}

cv::Point2d SyntheticStreet::principalPoint() const {
  // The horizon lies above the middle, to show more of the road.
  return {0.5 * (parameters_.width - 1), 0.42 * (parameters_.height - 1)};
}

StreetFrame SyntheticStreet::render(int index) const {
  requireArgument(index >= 0, "index", index, "at least 0");
  const Scene scene(parameters_, principalPoint(), index);
  const cv::Size size(parameters_.width, parameters_.height);
  StreetFrame frame;
  frame.left.create(size, CV_8UC1);
  frame.right.create(size, CV_8UC1);
  frame.disparity.create(size, CV_32FC1);

  const auto gray = [&](double camera_x, int x, int y) {
    double sum = 0.0;
    for (const auto& sample : SAMPLES) {
      sum += std::min(1.0, scene.shade(scene.cast(camera_x, x + sample[0], y + sample[1]), camera_x));
    }
    const std::uint64_t image =
        street::hash(parameters_.seed, 2 * static_cast<std::uint64_t>(index) + (camera_x > 0.0 ? 1 : 0));
    const std::uint64_t pixel = static_cast<std::uint64_t>(y) * parameters_.width + x;
    return cv::saturate_cast<uchar>(255.0 / SAMPLES.size() * sum +
                                    parameters_.noise * standardNoise(street::hash(image, pixel)));
  };
  cv::parallel_for_(cv::Range(0, size.height), [&](const cv::Range& rows) {
    for (int y = rows.start; y < rows.end; ++y) {
      for (int x = 0; x < size.width; ++x) {
        frame.left.at<uchar>(y, x) = gray(0.0, x, y);
        frame.right.at<uchar>(y, x) = gray(parameters_.baseline, x, y);
        const Hit hit = scene.cast(0.0, x, y);
        frame.disparity.at<float>(y, x) =
            scene.isSeenByRight(hit, x, y)
                ? static_cast<float>(parameters_.focal_length * parameters_.baseline / hit.depth)
                : 0.0F;
      }
    }
  });
  return frame;
}

}  // namespace disparity_refinement
