#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

/// What stands in the synthetic street and what its surfaces look like; SyntheticStreet casts the rays.
///
/// World coordinates [m]: x to the right, y down, z along the street; the origin is the left camera of frame
/// 0.
///
/// Everything random is a hash of a seed and of the thing it belongs to, never drawn from a common sequence,
/// so it does not depend on the order of work. Only exactly rounded arithmetic is used (no std::pow or
/// std::sin, none of the std:: distributions): the same bits everywhere.
namespace disparity_refinement::street {

using Vec = Eigen::Vector3d;

/// Distance of the backdrop, the sky and the last houses, from the camera [m].
constexpr double BACKDROP_DISTANCE = 200.0;

/// Hash of two numbers in which every bit of them changes every bit.
std::uint64_t hash(std::uint64_t a, std::uint64_t b);

enum class Material { PLAIN, PAVEMENT, FACADE, ROOF, FOLIAGE, CAR_BODY, CAR_CABIN };

struct HalfSpace {
  Vec normal;     ///< Outward, of unit length.
  double offset;  ///< Inside: normal . p <= offset.
};

/// A box whose corners are cut off by planes, or the ellipsoid inscribed in the box.
struct Solid {
  Vec low, high;  ///< Opposite corners of the box.
  Material material = Material::PLAIN;
  double albedo = 0.5;
  std::uint32_t seed = 0;  ///< Of its texture.
  bool ellipsoid = false;
  std::vector<HalfSpace> cuts;

  Vec centre() const { return 0.5 * (low + high); }
  Vec radii() const { return 0.5 * (high - low); }
};

/// All solids from a little behind the camera to the backdrop, `time` [s] after frame 0, with the camera at
/// z.
std::vector<Solid> layOut(std::uint32_t seed, double camera_z, double time);

/// Share of the light that a point of the road reflects, 0...1. Detail smaller than pixel_size [m] is left
/// out: sampled, it would look different in the two images.
double roadAlbedo(const Vec& point, double pixel_size, std::uint32_t seed);

/// The same for a point on a solid.
double albedo(const Solid& solid, const Vec& point, const Vec& normal, double pixel_size);

/// Brightness of the backdrop, 0...1. @param point  relative to the camera.
double backdropBrightness(const Vec& point, std::uint32_t seed);

}  // namespace disparity_refinement::street
