#include "disparity_refinement/refinement/PlaneFit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core/hal/intrin.hpp>

namespace disparity_refinement {
namespace {

// Points that score a trial: more hardly change the choice.
constexpr int MAX_SAMPLE_SIZE = 256;
// Points scored between two looks at whether the trial can still win; the compiler makes vectors of them.
constexpr int BLOCK_SIZE = 32;
static_assert(MAX_SAMPLE_SIZE % BLOCK_SIZE == 0, "the last block of a sample may be padded");

// Points whose sums are taken in single precision. A lane adds up a quarter of them: the sums of disparities
// in steps of 1/16 px are exact unless a segment is very large.
constexpr int SUM_BLOCK_SIZE = 64;
static_assert(SUM_BLOCK_SIZE % 4 == 0, "only the last vector of a segment may be padded");

// The stopping rule promises one trial without outliers, but such a trial may still be poor, for inliers are
// noisy too. So RANSAC goes on for a multiple of the rule's trials, and for some trials at least, as far as
// max_iterations allows.
constexpr int TRIALS_FACTOR = 4;
constexpr int MIN_TRIALS = 30;

// SplitMix64 (Steele, Lea and Flood, OOPSLA 2014). Any seed is good, and the numbers are the same with every
// standard library, which those of the distributions of <random> are not.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() {
    state_ += 0x9E3779B97F4A7C15U;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31);
  }

 private:
  std::uint64_t state_;
};

// The points that score a trial. Coordinates are relative to the origin of the segment's points: single
// precision is enough.
struct Sample {
  int size = 0;
  std::array<float, MAX_SAMPLE_SIZE> x, y, d;
};

// d = a x + b y + c, relative to the origin of the segment's points.
struct Plane {
  double a = 0.0, b = 0.0, c = 0.0;
};

// All points, or one drawn at random from each of MAX_SAMPLE_SIZE equal parts of the points in raster order:
// spread out like a regular stride, but never in step with the shape of the segment.
void drawSample(const SegmentPoints& points, Random& random, Sample& sample) {
  sample.size = std::min(points.size, MAX_SAMPLE_SIZE);
  const auto take = [&](int i, int point) {
    sample.x[i] = static_cast<float>(points.x[point]);
    sample.y[i] = static_cast<float>(points.y[point]);
    sample.d[i] = points.d[point];
  };
  if (points.size <= MAX_SAMPLE_SIZE) {
    for (int i = 0; i < sample.size; ++i) take(i, i);
  } else {
    const std::uint64_t size = static_cast<std::uint64_t>(points.size);
    for (int i = 0; i < MAX_SAMPLE_SIZE; ++i) {
      // The part and a random position inside it, as a binary fraction of all points.
      const std::uint64_t position = (static_cast<std::uint64_t>(i) << 24) + (random.next() >> 40);
      take(i, static_cast<int>((position * size) >> 32));
    }
  }
  // Fill the last block with points that are inliers of no plane.
  for (int i = sample.size; i % BLOCK_SIZE != 0; ++i) {
    sample.x[i] = sample.y[i] = 0.0F;
    sample.d[i] = std::numeric_limits<float>::quiet_NaN();
  }
}

bool withinSlopes(const Plane& plane, const PlaneRefinementParameters& parameters) {
  return std::abs(plane.a) <= parameters.max_slope_x && std::abs(plane.b) <= parameters.max_slope_y;
}

// 0 ... n - 1 for n <= MAX_SAMPLE_SIZE, from the last 21 random bits.
int numberBelow(int n, std::uint64_t bits) {
  return static_cast<int>(((bits & 0x1FFFFF) * static_cast<std::uint64_t>(n)) >> 21);
}

// The plane through three points drawn at random; false if they lie on a line or the plane is too steep.
bool drawPlane(const Sample& sample, const PlaneRefinementParameters& parameters, Random& random,
               Plane& plane) {
  const std::uint64_t bits = random.next();
  const int i = numberBelow(sample.size, bits >> 43);
  int j = numberBelow(sample.size - 1, bits >> 22);
  if (j >= i) ++j;
  int k = numberBelow(sample.size - 2, bits >> 1);
  if (k >= std::min(i, j)) ++k;
  if (k >= std::max(i, j)) ++k;

  const double xj = sample.x[j] - sample.x[i], yj = sample.y[j] - sample.y[i], dj = sample.d[j] - sample.d[i];
  const double xk = sample.x[k] - sample.x[i], yk = sample.y[k] - sample.y[i], dk = sample.d[k] - sample.d[i];
  const double determinant = xj * yk - xk * yj;  // Exact, for the coordinates are integers.
  if (determinant == 0.0) return false;
  plane.a = (dj * yk - dk * yj) / determinant;
  plane.b = (xj * dk - xk * dj) / determinant;
  plane.c = sample.d[i] - plane.a * sample.x[i] - plane.b * sample.y[i];
  return withinSlopes(plane, parameters);
}

// Number of inliers in the sample; any number up to to_beat if there are not more than that.
int countInliers(const Sample& sample, const Plane& plane, double inlier_threshold, int to_beat) {
  const float a = static_cast<float>(plane.a), b = static_cast<float>(plane.b),
              c = static_cast<float>(plane.c);
  const float threshold = static_cast<float>(inlier_threshold);
  int inliers = 0;
  for (int begin = 0; begin < sample.size && inliers + sample.size - begin > to_beat; begin += BLOCK_SIZE) {
    const float *x = &sample.x[begin], *y = &sample.y[begin], *d = &sample.d[begin];
    int block = 0;
    for (int i = 0; i < BLOCK_SIZE; ++i)
      block += std::abs(a * x[i] + b * y[i] + c - d[i]) <= threshold ? 1 : 0;
    inliers += block;
  }
  return inliers;
}

// The stopping rule: the least n with (1 - w^3)^n <= 1 - confidence, w the share of inliers; max_iterations +
// 1 if it is larger than max_iterations. By products, since logarithms differ between machines.
int requiredTrials(double w, const PlaneRefinementParameters& parameters) {
  const double miss = 1.0 - w * w * w;
  double all_miss = miss;
  int n = 1;
  for (; all_miss > 1.0 - parameters.confidence && n <= parameters.max_iterations; ++n) all_miss *= miss;
  return n;
}

// Number of the inliers of a plane, and sums over them.
enum Moment { N, X, Y, D, XX, XY, YY, XD, YD, MOMENTS };
using Moments = std::array<double, MOMENTS>;

// In a fixed order, which the reductions of OpenCV do not promise.
double sumOfLanes(const cv::v_float32x4& lanes) {
  float values[4];
  cv::v_store(values, lanes);
  return (static_cast<double>(values[0]) + values[1]) + (static_cast<double>(values[2]) + values[3]);
}

Moments sumInliers(const SegmentPoints& points, const Plane& plane, double inlier_threshold) {
  const cv::v_float32x4 a = cv::v_setall_f32(static_cast<float>(plane.a)),
                        b = cv::v_setall_f32(static_cast<float>(plane.b)),
                        c = cv::v_setall_f32(static_cast<float>(plane.c)),
                        threshold = cv::v_setall_f32(static_cast<float>(inlier_threshold)),
                        one = cv::v_setall_f32(1.0F);
  Moments sums = {};
  for (int begin = 0; begin < points.size; begin += SUM_BLOCK_SIZE) {
    cv::v_float32x4 block[MOMENTS];
    for (auto& lanes : block) lanes = cv::v_setzero_f32();
    const int end = std::min(begin + SUM_BLOCK_SIZE, points.size);
    for (int i = begin; i < end; i += 4) {
      const cv::v_float32x4 x = cv::v_cvt_f32(cv::v_load(&points.x[i])),
                            y = cv::v_cvt_f32(cv::v_load(&points.y[i])), d = cv::v_load(&points.d[i]);
      // False for NaN: neither padding nor its value counts.
      const cv::v_float32x4 is_inlier = cv::v_abs(a * x + b * y + c - d) <= threshold;
      const cv::v_float32x4 inlier_x = x & is_inlier, inlier_y = y & is_inlier, inlier_d = d & is_inlier;
      block[N] += one & is_inlier;
      block[X] += inlier_x;
      block[Y] += inlier_y;
      block[D] += inlier_d;
      block[XX] += inlier_x * x;
      block[XY] += inlier_x * y;
      block[YY] += inlier_y * y;
      block[XD] += inlier_d * x;
      block[YD] += inlier_d * y;
    }
    for (int k = 0; k < MOMENTS; ++k) sums[k] += sumOfLanes(block[k]);
  }
  return sums;
}

// Replaces `plane` by the least-squares plane of its inliers among all points, unless that is too steep.
// Returns the number of these inliers. If they do not span a plane, the quotients are no numbers and `plane`
// stays.
int refit(const SegmentPoints& points, const PlaneRefinementParameters& parameters, Plane& plane) {
  const Moments sums = sumInliers(points, plane, parameters.inlier_threshold);
  // Normal equations about the centroid.
  const double mean_x = sums[X] / sums[N], mean_y = sums[Y] / sums[N];
  const double xx = sums[XX] - mean_x * sums[X];
  const double xy = sums[XY] - mean_x * sums[Y];
  const double yy = sums[YY] - mean_y * sums[Y];
  const double xd = sums[XD] - mean_x * sums[D];
  const double yd = sums[YD] - mean_y * sums[D];
  const double determinant = xx * yy - xy * xy;
  Plane fitted;
  fitted.a = (xd * yy - yd * xy) / determinant;
  fitted.b = (yd * xx - xd * xy) / determinant;
  fitted.c = (sums[D] - fitted.a * sums[X] - fitted.b * sums[Y]) / sums[N];
  if (withinSlopes(fitted, parameters)) plane = fitted;
  return static_cast<int>(sums[N]);
}

}  // namespace

SegmentPlane fitPlane(const cv::Mat& disparity, const DisparityRange& range, RunSpan runs, std::uint64_t seed,
                      const PlaneRefinementParameters& parameters, SegmentPoints& points) {
  SegmentPlane result;
  if (runs.begin() == runs.end()) return result;
  points.gather(disparity, range, runs);
  result.pixels = points.pixels;
  result.valid = points.size;
  // The quotient, not the product with pixels: 3 of 10 then reach a fraction of 0.3 exactly.
  const double valid_fraction = static_cast<double>(result.valid) / result.pixels;
  if (result.valid < parameters.min_valid_points || valid_fraction < parameters.min_valid_fraction) {
    result.status = PlaneStatus::TOO_FEW_POINTS;
    return result;
  }

  Random random(seed);
  Sample sample;
  drawSample(points, random, sample);

  Plane best;
  int most_inliers = 0;
  int required = 0;  // By the stopping rule for the best plane; 0 as long as nobody has asked.
  const auto requiredNow = [&] {
    if (required == 0) {
      required = requiredTrials(static_cast<double>(most_inliers) / sample.size, parameters);
    }
    return required;
  };
  for (; result.iterations < parameters.max_iterations; ++result.iterations) {
    if (result.iterations >= MIN_TRIALS && result.iterations / TRIALS_FACTOR >= requiredNow()) break;
    if (most_inliers == sample.size) continue;  // No trial can be better: it need not be drawn.
    Plane plane;
    if (!drawPlane(sample, parameters, random, plane)) continue;
    const int inliers = countInliers(sample, plane, parameters.inlier_threshold, most_inliers);
    if (inliers <= most_inliers) continue;
    best = plane;
    most_inliers = inliers;
    required = 0;
  }
  if (most_inliers == 0) {
    result.status = PlaneStatus::DEGENERATE;
    return result;
  }
  if (requiredNow() > parameters.max_iterations) {
    result.status = PlaneStatus::MAX_ITERATIONS;
    return result;
  }

  result.inliers = refit(points, parameters, best);
  result.a = best.a;
  result.b = best.b;
  result.c = best.c - best.a * points.origin_x - best.b * points.origin_y;
  result.status = PlaneStatus::ACCEPTED;
  return result;
}

}  // namespace disparity_refinement
