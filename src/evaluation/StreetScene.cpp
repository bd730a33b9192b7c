#include "StreetScene.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "disparity_refinement/evaluation/SyntheticStreet.hpp"

namespace disparity_refinement::street {
namespace {

// Cross section of the street: x of its borders from left to right, y of its levels [m].
constexpr double LEFT_FRONT = -9.8;  // of the houses
constexpr double LEFT_KERB = -7.3;
constexpr double LEFT_PARKING = -5.2;
constexpr double CENTRE_LINE = -1.75;
constexpr double RIGHT_PARKING = 2.0;
constexpr double RIGHT_KERB = 4.2;
constexpr double RIGHT_FRONT = 6.8;
constexpr double ROAD = SyntheticStreet::CAMERA_HEIGHT;
constexpr double PAVEMENT = ROAD - 0.12;

constexpr double REAR_VIEW =
    30.0;  // what stands at most this far behind the camera may cast a shadow ahead [m]
constexpr double LOT_LENGTH = 16.0;     // of a house with its garden, along z [m]
constexpr double PARKING_LENGTH = 6.5;  // of a parking space [m]
constexpr double ONCOMING_GAP = 45.0;   // between oncoming cars [m]
constexpr double ONCOMING_SPEED = 9.0;  // [m/s]

// Kinds of things, to keep their random numbers apart.
enum Kind : std::uint64_t { LOT = 1, PARKING_SPACE = 2, ONCOMING_CAR = 3, LEADING_CAR = 4 };

/// The finaliser of SplitMix64.
std::uint64_t mix(std::uint64_t value) {
  value = (value ^ (value >> 30U)) * 0xbf58476d1ce4e5b9U;
  value = (value ^ (value >> 27U)) * 0x94d049bb133111ebU;
  return value ^ (value >> 31U);
}

/// The random choices for one thing. One draw a statement: the order of two in one expression is the
/// compiler's.
class Dice {
 public:
  Dice(std::uint32_t seed, Kind kind, std::int64_t index)
      : state_(hash(hash(seed, kind), static_cast<std::uint64_t>(index))) {}

  double between(double low, double high) {
    state_ = hash(state_, 0);
    return low + (high - low) * static_cast<double>(state_ >> 11U) * 0x1p-53;
  }
  bool chance(double probability) { return between(0.0, 1.0) < probability; }
  std::uint32_t seed() { return static_cast<std::uint32_t>(between(0.0, 4294967296.0)); }

 private:
  std::uint64_t state_;
};

/// -1 ... 1
double latticeValue(int x, int y, int z, std::uint32_t seed) {
  std::uint32_t h = seed + static_cast<std::uint32_t>(x) * 0x8da6b343U +
                    static_cast<std::uint32_t>(y) * 0xd8163841U + static_cast<std::uint32_t>(z) * 0xcb1ab31fU;
  h = (h ^ (h >> 15U)) * 0x2c1b3c6dU;
  h = (h ^ (h >> 12U)) * 0x297a2d39U;
  return static_cast<double>(h ^ (h >> 15U)) * 0x1p-31 - 1.0;
}

double mixed(double a, double b, double share_of_b) { return a + (b - a) * share_of_b; }

/// Value noise, -1 ... 1: random values at the corners of cells of the given size [m], smoothly interpolated;
/// 0 where a pixel covers whole cells.
double noise(const Vec& point, double cell, double pixel_size, std::uint32_t seed) {
  const double weight = std::clamp(cell / pixel_size - 0.5, 0.0, 1.0);
  if (weight == 0.0) {
    return 0.0;
  }
  std::array<int, 3> i{};
  std::array<double, 3> s{};
  for (int k = 0; k < 3; ++k) {
    const double scaled = point[k] / cell;
    i[k] = static_cast<int>(std::floor(scaled));
    const double r = scaled - i[k];
    s[k] = r * r * (3.0 - 2.0 * r);
  }
  const auto edge = [&](int y, int z) {
    return mixed(latticeValue(i[0], y, z, seed), latticeValue(i[0] + 1, y, z, seed), s[0]);
  };
  const auto face = [&](int z) { return mixed(edge(i[1], z), edge(i[1] + 1, z), s[1]); };
  return weight * mixed(face(i[2]), face(i[2] + 1), s[2]);
}

/// Position inside a period, 0 ... period.
double within(double value, double period) { return value - period * std::floor(value / period); }

bool isBetween(double value, double low, double high) { return value >= low && value < high; }

// ---- Layout ----

Solid box(const Vec& low, const Vec& high, Material material, double albedo, std::uint32_t seed) {
  Solid solid;
  solid.low = low;
  solid.high = high;
  solid.material = material;
  solid.albedo = albedo;
  solid.seed = seed;
  return solid;
}

Solid ellipsoid(const Vec& centre, const Vec& radii, Material material, double albedo, std::uint32_t seed) {
  Solid solid = box(centre - radii, centre + radii, material, albedo, seed);
  solid.ellipsoid = true;
  return solid;
}

/// Cuts off what lies outside the plane through `point`, which is relative to the centre.
void cut(Solid& solid, const Vec& normal, const Vec& point) {
  const Vec unit = normal / std::sqrt(normal.dot(normal));
  solid.cuts.push_back({unit, unit.dot(solid.centre() + point)});
}

/// An upright octagonal post.
Solid post(double x, double z, double foot, double height, double radius, double albedo, std::uint32_t seed) {
  Solid solid = box({x - radius, foot - height, z - radius}, {x + radius, foot, z + radius}, Material::PLAIN,
                    albedo, seed);
  for (const double sx : {-1.0, 1.0}) {
    for (const double sz : {-1.0, 1.0}) {
      cut(solid, {sx, 0.0, sz}, {sx * radius, 0.0, sz * 0.414 * radius});
    }
  }
  return solid;
}

/// @param heading  1: it shows its rear to the camera, -1: its front.
void addCar(double x, double z, double heading, Dice& dice, std::vector<Solid>& solids) {
  const double half_width = dice.between(0.82, 0.9), half_length = dice.between(1.9, 2.3);
  const double waist = dice.between(0.88, 0.98), roof = waist + dice.between(0.5, 0.62);
  const double paint = dice.chance(0.4) ? dice.between(0.05, 0.15) : dice.between(0.25, 0.85);
  const bool estate = dice.chance(0.5);
  const std::uint32_t seed = dice.seed();

  Solid body = box({x - half_width, ROAD - waist, z - half_length},
                   {x + half_width, ROAD - 0.2, z + half_length}, Material::CAR_BODY, paint, seed);
  const double half_height = body.radii().y();
  for (const double side : {-1.0, 1.0}) {
    cut(body, {side, -0.25, 0.0}, {side * half_width, 0.0, 0.0});
    for (const double end : {-1.0, 1.0}) {
      cut(body, {side * 0.5, 0.0, end}, {side * 0.6 * half_width, 0.0, end * half_length});
    }
  }
  cut(body, {0.0, -1.0, 0.16 * heading}, {0.0, -half_height, 0.1 * heading});         // bonnet
  cut(body, {0.0, -0.5, heading}, {0.0, -0.3 * half_height, heading * half_length});  // front
  cut(body, {0.0, -0.15, -heading}, {0.0, 0.0, -heading * half_length});              // rear
  cut(body, {0.0, 1.0, heading}, {0.0, 0.5 * half_height, heading * half_length});    // apron
  solids.push_back(body);

  const double cabin_rear = estate ? -half_length + 0.05 : -half_length + 0.6;
  const double cabin_front = half_length - 0.95;
  const double middle = z + heading * 0.5 * (cabin_front + cabin_rear);
  const double cabin_half_length = 0.5 * (cabin_front - cabin_rear);
  Solid cabin = box({x - half_width + 0.06, ROAD - roof, middle - cabin_half_length},
                    {x + half_width - 0.06, ROAD - waist + 0.1, middle + cabin_half_length},
                    Material::CAR_CABIN, paint, seed);
  const double cabin_half_height = cabin.radii().y();
  for (const double side : {-1.0, 1.0}) {
    cut(cabin, {side, -0.35, 0.0}, {side * cabin.radii().x(), cabin_half_height, 0.0});
    cut(cabin, {side * 0.4, -1.0, 0.0}, {side * 0.55 * cabin.radii().x(), -cabin_half_height, 0.0});
  }
  cut(cabin, {0.0, -1.1, heading}, {0.0, cabin_half_height, heading * cabin_half_length});  // windscreen
  cut(cabin, {0.0, estate ? -0.3 : -1.0, -heading}, {0.0, cabin_half_height, -heading * cabin_half_length});
  solids.push_back(cabin);

  for (const double side : {-1.0, 1.0}) {
    for (const double end : {-0.62, 0.62}) {
      solids.push_back(ellipsoid({x + side * (half_width - 0.1), ROAD - 0.31, z + end * half_length},
                                 {0.13, 0.31, 0.31}, Material::PLAIN, 0.05, seed));
    }
  }
}

void addTree(double x, double z, Dice& dice, std::vector<Solid>& solids) {
  const double height = dice.between(3.6, 5.0), radius = dice.between(1.0, 1.5);
  const double albedo = dice.between(0.25, 0.4);
  solids.push_back(post(x, z, PAVEMENT, height, 0.11, 0.25, dice.seed()));
  for (int i = 0; i < 12; ++i) {
    const double r = radius * dice.between(0.3, 0.55);
    const double dx = dice.between(-0.75, 0.75), dy = dice.between(-1.1, 0.5), dz = dice.between(-0.75, 0.75);
    const Vec centre(x + dx * radius, PAVEMENT - height + dy * radius, z + dz * radius);
    solids.push_back(ellipsoid(centre, {r, 0.9 * r, r}, Material::FOLIAGE, albedo, dice.seed()));
  }
}

/// @param side  1: right, -1: left.
void addLamp(double x, double z, double side, Dice& dice, std::vector<Solid>& solids) {
  solids.push_back(post(x, z, PAVEMENT, 6.0, 0.08, 0.3, dice.seed()));
  const double tip = x - side * 1.2;
  solids.push_back(box({std::min(x, tip), PAVEMENT - 6.1, z - 0.06},
                       {std::max(x, tip), PAVEMENT - 6.0, z + 0.06}, Material::PLAIN, 0.3, dice.seed()));
}

/// @param front  x of the house front. @param side  1: right, -1: left.
void addHouse(double front, double z, double length, double side, Dice& dice, std::vector<Solid>& solids) {
  const double storeys = dice.chance(0.35) ? 3.0 : 2.0;
  const double height = 2.9 * storeys + dice.between(0.4, 0.9);
  const double depth = 10.0;
  const double left = side > 0.0 ? front : front - depth;
  const double top = PAVEMENT - height;
  const std::uint32_t seed = dice.seed();
  solids.push_back(box({left, top, z}, {left + depth, PAVEMENT, z + length}, Material::FACADE,
                       dice.between(0.5, 0.85), seed));
  if (dice.chance(0.75)) {
    const double rise = dice.between(2.5, 4.0), eaves = 0.35;
    Solid roof = box({left - eaves, top - rise, z - 0.2}, {left + depth + eaves, top, z + length + 0.2},
                     Material::ROOF, dice.between(0.2, 0.4), seed);
    for (const double slope : {-1.0, 1.0}) {
      cut(roof, {slope * rise, -roof.radii().x(), 0.0}, {0.0, -0.5 * rise, 0.0});
    }
    solids.push_back(roof);
  }
}

void addLot(double side, std::int64_t number, std::uint32_t seed, std::vector<Solid>& solids) {
  Dice dice(seed, LOT, 2 * number + (side > 0.0 ? 1 : 0));
  const double z = LOT_LENGTH * static_cast<double>(number);
  const double front = side > 0.0 ? RIGHT_FRONT : LEFT_FRONT;
  const double kerb = side > 0.0 ? RIGHT_KERB : LEFT_KERB;
  const double setback = dice.chance(0.5) ? dice.between(0.8, 2.5) : 0.0;
  const double length = dice.between(11.0, 15.8);
  addHouse(front + side * setback, z, length, side, dice, solids);
  if (setback > 0.0) {
    // A hedge or a low wall stands before the garden, with a gap for the gate.
    const double height = dice.between(0.7, 1.2);
    const Material material = dice.chance(0.6) ? Material::FOLIAGE : Material::PLAIN;
    const double albedo = material == Material::FOLIAGE ? 0.25 : dice.between(0.4, 0.7);
    solids.push_back(box({std::min(front, front + side * 0.4), PAVEMENT - height, z + 1.5},
                         {std::max(front, front + side * 0.4), PAVEMENT, z + length}, material, albedo,
                         dice.seed()));
  }
  if (dice.chance(0.55)) {
    addTree(kerb + side * 0.7, z + dice.between(2.0, 7.0), dice, solids);
  }
  if (dice.chance(0.4)) {
    addLamp(kerb + side * 0.5, z + dice.between(9.0, 14.0), side, dice, solids);
  }
  if (dice.chance(0.4)) {
    const double x = kerb + side * 0.4, sign_z = z + dice.between(0.0, 15.0);
    solids.push_back(post(x, sign_z, PAVEMENT, 2.6, 0.04, 0.45, dice.seed()));
    solids.push_back(box({x - 0.3, PAVEMENT - 2.8, sign_z - 0.06}, {x + 0.3, PAVEMENT - 2.2, sign_z - 0.04},
                         Material::PLAIN, 0.9, dice.seed()));
  }
}

// ---- Materials ----

/// Plaster with rows of windows, a door here and there and a darker base. @param along, up  position on the
/// wall [m].
double facadeAlbedo(const Solid& wall, const Vec& point, double along, double up, double pixel_size) {
  Dice dice(wall.seed, LOT, 0);
  const double storey = 2.9, pitch = dice.between(2.3, 3.2);
  const double half_width = dice.between(0.45, 0.65), sill = 0.95, lintel = sill + dice.between(1.2, 1.5);
  const double glass = dice.between(0.06, 0.16), frame = dice.between(0.6, 0.9);
  const double plaster = wall.albedo * (1.0 + 0.03 * noise(point, 1.7, pixel_size, wall.seed) +
                                        0.02 * noise(point, 0.11, pixel_size, wall.seed + 1));
  const double column = std::floor(along / pitch);
  const double x = std::abs(within(along, pitch) - 0.5 * pitch);  // from the middle of the window
  const double y = within(up, storey);
  const bool has_door = up < storey && within(column + wall.seed % 4, 4.0) == 0.0;
  if (has_door && x < 0.55 && y < 2.1) {
    return x < 0.47 ? 0.5 * glass + 0.12 : frame;
  }
  if (!has_door && x < half_width && isBetween(y, sill, lintel)) {
    const bool is_frame = x > half_width - 0.08 || x < 0.03 || y < sill + 0.08 || y > lintel - 0.08;
    // Glass mirrors the sky the more, the higher the line of sight meets it.
    return is_frame ? frame : glass * (1.0 + 0.5 * (y - sill));
  }
  return up < 0.55 ? 0.6 * plaster : plaster;
}

}  // namespace

std::uint64_t hash(std::uint64_t a, std::uint64_t b) { return mix(mix(a + 0x9e3779b97f4a7c15U) ^ b); }

std::vector<Solid> layOut(std::uint32_t seed, double camera_z, double time) {
  std::vector<Solid> solids;
  const double rear = camera_z - REAR_VIEW, far = camera_z + BACKDROP_DISTANCE;
  const auto number = [](double z, double length) {
    return static_cast<std::int64_t>(std::floor(z / length));
  };

  for (const double side : {-1.0, 1.0}) {
    const double kerb = side > 0.0 ? RIGHT_KERB : LEFT_KERB;
    solids.push_back(box({std::min(kerb, side * 100.0), PAVEMENT, rear},
                         {std::max(kerb, side * 100.0), ROAD, far}, Material::PAVEMENT, 0.55, seed));
    for (std::int64_t i = number(rear, LOT_LENGTH); i <= number(far, LOT_LENGTH); ++i) {
      addLot(side, i, seed, solids);
    }
    for (std::int64_t i = number(rear, PARKING_LENGTH); i <= number(far, PARKING_LENGTH); ++i) {
      Dice dice(seed, PARKING_SPACE, 2 * i + (side > 0.0 ? 1 : 0));
      if (dice.chance(0.5)) {
        const double x = (side > 0.0 ? RIGHT_KERB : LEFT_KERB) - side * 1.05 + dice.between(-0.1, 0.1);
        const double z = PARKING_LENGTH * (static_cast<double>(i) + 0.5) + dice.between(-0.5, 0.5);
        addCar(x, z, side, dice, solids);
      }
    }
  }

  const double driven = ONCOMING_SPEED * time;
  for (std::int64_t i = number(rear + driven, ONCOMING_GAP); i <= number(far + driven, ONCOMING_GAP); ++i) {
    Dice dice(seed, ONCOMING_CAR, i);
    const double z = ONCOMING_GAP * static_cast<double>(i) + dice.between(0.0, 30.0) - driven;
    addCar(0.5 * (CENTRE_LINE + LEFT_PARKING), z, -1.0, dice, solids);
  }

  Dice dice(seed, LEADING_CAR, 0);
  const double gap = 22.0 + 5.0 * noise({0.0, 0.0, time}, 3.0, 0.0, seed);
  addCar(0.2, camera_z + gap, 1.0, dice, solids);
  return solids;
}

double roadAlbedo(const Vec& point, double pixel_size, std::uint32_t seed) {
  const double x = point.x(), z = point.z();
  const double grain = 0.07 * noise(point, 0.06, pixel_size, seed) +
                       0.05 * noise(point, 0.3, pixel_size, seed + 1) +
                       0.04 * noise(point, 2.0, pixel_size, seed + 2);
  const bool is_dash = std::abs(x - CENTRE_LINE) < 0.07 && within(z, 9.0) < 3.0;
  const bool is_parking_line =
      (std::abs(x - RIGHT_PARKING) < 0.05 || std::abs(x - LEFT_PARKING) < 0.05) && within(z, 2.0) < 1.0;
  if (is_dash || is_parking_line) {
    return 0.75 * (1.0 + grain);
  }
  return 0.42 * (1.0 + grain);
}

double albedo(const Solid& solid, const Vec& point, const Vec& normal, double pixel_size) {
  // The texture belongs to the solid, also to one that drives.
  const Vec p = point - solid.low;
  switch (solid.material) {
    case Material::PAVEMENT: {
      const double from_kerb = std::min(std::abs(point.x() - LEFT_KERB), std::abs(point.x() - RIGHT_KERB));
      if (from_kerb < 0.15) {
        return 0.66;
      }
      if (point.x() > RIGHT_FRONT || point.x() < LEFT_FRONT) {  // lawn
        return 0.25 * (1.0 + 0.25 * noise(point, 0.1, pixel_size, solid.seed) +
                       0.1 * noise(point, 0.8, pixel_size, solid.seed + 1));
      }
      const double joint = within(point.z(), 1.0) < 0.03 && pixel_size < 0.1 ? 0.8 : 1.0;
      return joint * solid.albedo *
             (1.0 + 0.04 * noise(point, 0.08, pixel_size, solid.seed) +
              0.06 * noise(point, 1.5, pixel_size, solid.seed));
    }
    case Material::FACADE:
      return facadeAlbedo(solid, point, std::abs(normal.x()) > 0.5 ? p.z() : p.x(),
                          solid.high.y() - point.y(), pixel_size);
    case Material::ROOF: {
      const double row = pixel_size < 0.3 && within(p.y(), 0.3) < 0.06 ? 0.8 : 1.0;
      return row * solid.albedo * (1.0 + 0.1 * noise(p, 0.25, pixel_size, solid.seed));
    }
    case Material::FOLIAGE:
      return solid.albedo * (1.0 + 0.5 * noise(p, 0.4, pixel_size, solid.seed) +
                             0.6 * noise(p, 0.1, pixel_size, solid.seed + 1));
    case Material::CAR_BODY: {
      if (std::abs(normal.z()) > 0.7) {  // plate and lights
        const double x = std::abs(point.x() - solid.centre().x()), up = solid.high.y() - point.y();
        if (x < 0.26 && isBetween(up, 0.28, 0.39)) {
          return 0.9;
        }
        if (isBetween(x, 0.52, 0.75) && isBetween(up, 0.38, 0.56)) {
          return 0.35;
        }
        if (up < 0.15) {
          return 0.1;
        }
      }
      return solid.albedo;
    }
    case Material::CAR_CABIN: {
      const bool is_roof = normal.y() < -0.85;
      const double down = p.y() / (solid.high.y() - solid.low.y());
      const bool is_pillar = std::abs(normal.x()) > 0.5 && std::abs(within(p.z(), 1.1) - 0.15) < 0.05;
      return is_roof || is_pillar || down < 0.12 ? solid.albedo : 0.08;
    }
    case Material::PLAIN:
      break;
  }
  return solid.albedo * (1.0 + 0.03 * noise(p, 0.3, pixel_size, solid.seed));
}

double backdropBrightness(const Vec& point, std::uint32_t seed) {
  const double up = SyntheticStreet::CAMERA_HEIGHT - point.y();
  const double column = std::floor(point.x() / 9.0);
  const double roofs = 7.0 + 3.0 * noise({column, 0.0, 0.0}, 1.0, 0.0, seed);
  const double trees = 8.0 + 4.0 * noise(point, 6.0, 0.0, seed + 1) + 1.5 * noise(point, 1.5, 0.0, seed + 2);
  if (up < roofs) {
    const bool is_window = within(point.x(), 3.0) < 1.2 && isBetween(within(up, 3.0), 1.0, 2.4);
    return (is_window ? 0.3 : 0.5) + 0.06 * noise({column, 1.0, 0.0}, 1.0, 0.0, seed);
  }
  if (up < trees) {
    return 0.3 + 0.06 * noise(point, 1.2, 0.0, seed + 3);
  }
  return std::min(0.97, 0.9 - 0.0015 * up + 0.02 * noise(point, 40.0, 0.0, seed + 4));
}

}  // namespace disparity_refinement::street
