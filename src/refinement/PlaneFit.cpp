#include "disparity_refinement/refinement/PlaneFit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

namespace disparity_refinement {
namespace {

// Points that score a trial: more hardly change the choice.
constexpr int MAX_SAMPLE_SIZE = 256;
// Points scored between two looks at whether the trial can still win; the compiler makes vectors of them.
constexpr int BLOCK_SIZE = 32;
static_assert(MAX_SAMPLE_SIZE % BLOCK_SIZE == 0, "the last block of a sample may be padded");

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

  // 0 ... n - 1
  int below(int n) {
    state_ += 0x9E3779B97F4A7C15U;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    z ^= z >> 31;
    return static_cast<int>(((z >> 32) * static_cast<std::uint64_t>(n)) >> 32);
  }

 private:
  std::uint64_t state_;
};

// The points that score a trial. Coordinates are relative to their centroid: single precision is enough.
struct Sample {
  int size = 0;
  int origin_x = 0, origin_y = 0;
  std::array<float, MAX_SAMPLE_SIZE> x, y, d;
};

// d = a x + b y + c, relative to the origin of the sample.
struct Plane {
  double a = 0.0, b = 0.0, c = 0.0;
};

int countPixels(RunSpan runs) {
  int pixels = 0;
  for (const Run& run : runs) pixels += run.x_end - run.x_begin;
  return pixels;
}

int countValid(const cv::Mat& disparity, DisparityRange range, RunSpan runs) {
  int valid = 0;
  for (const Run& run : runs) {
    const float* row = disparity.ptr<float>(run.y);
    for (int x = run.x_begin; x < run.x_end; ++x) valid += range.isValid(row[x]) ? 1 : 0;
  }
  return valid;
}

// All points, or one drawn at random from each of MAX_SAMPLE_SIZE equal parts of the points in raster order:
// spread out like a regular stride, but never in step with the shape of the segment.
void drawSample(const cv::Mat& disparity, DisparityRange range, RunSpan runs, int valid, Random& random,
                Sample& sample) {
  sample.size = std::min(valid, MAX_SAMPLE_SIZE);
  const auto drawIndex = [&](std::int64_t part) {
    if (valid <= MAX_SAMPLE_SIZE) return static_cast<int>(part);
    const int begin = static_cast<int>(part * valid / MAX_SAMPLE_SIZE);
    const int end = static_cast<int>((part + 1) * valid / MAX_SAMPLE_SIZE);
    return begin + random.below(end - begin);
  };

  std::int64_t sum_x = 0, sum_y = 0;
  int n = 0, index = 0, next = drawIndex(0);
  for (const Run& run : runs) {
    const float* row = disparity.ptr<float>(run.y);
    for (int x = run.x_begin; x < run.x_end; ++x) {
      if (!range.isValid(row[x]) || index++ != next) continue;
      sample.x[n] = static_cast<float>(x);
      sample.y[n] = static_cast<float>(run.y);
      sample.d[n] = row[x];
      sum_x += x;
      sum_y += run.y;
      next = ++n < sample.size ? drawIndex(n) : -1;
    }
  }

  const int points = std::max(n, 1);
  sample.origin_x = static_cast<int>(sum_x / points);
  sample.origin_y = static_cast<int>(sum_y / points);
  for (int i = 0; i < sample.size; ++i) {
    sample.x[i] -= static_cast<float>(sample.origin_x);
    sample.y[i] -= static_cast<float>(sample.origin_y);
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

// The plane through three points drawn at random; false if they lie on a line or the plane is too steep.
bool drawPlane(const Sample& sample, const PlaneRefinementParameters& parameters, Random& random,
               Plane& plane) {
  const int i = random.below(sample.size);
  int j = random.below(sample.size - 1);
  if (j >= i) ++j;
  int k = random.below(sample.size - 2);
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

// Replaces `plane` by the least-squares plane of its inliers among all points, unless that is too steep.
// Returns the number of these inliers. They span a plane, for the points of the trial are among them.
int refit(const cv::Mat& disparity, DisparityRange range, RunSpan runs, const Sample& sample,
          const PlaneRefinementParameters& parameters, Plane& plane) {
  const double threshold = parameters.inlier_threshold;
  int inliers = 0;
  double sum_x = 0.0, sum_y = 0.0, sum_d = 0.0;
  double sum_xx = 0.0, sum_xy = 0.0, sum_yy = 0.0, sum_xd = 0.0, sum_yd = 0.0;
  for (const Run& run : runs) {
    const float* row = disparity.ptr<float>(run.y);
    const double y = run.y - sample.origin_y;
    const double start = plane.b * y + plane.c;
    // Along a run y is constant.
    int n = 0;
    double run_x = 0.0, run_d = 0.0, run_xx = 0.0, run_xd = 0.0;
    for (int column = run.x_begin; column < run.x_end; ++column) {
      const double x = column - sample.origin_x, d = row[column];
      if (!range.isValid(row[column]) || std::abs(plane.a * x + start - d) > threshold) continue;
      ++n;
      run_x += x;
      run_d += d;
      run_xx += x * x;
      run_xd += x * d;
    }
    inliers += n;
    sum_x += run_x;
    sum_y += n * y;
    sum_d += run_d;
    sum_xx += run_xx;
    sum_xy += run_x * y;
    sum_yy += n * y * y;
    sum_xd += run_xd;
    sum_yd += run_d * y;
  }

  // Normal equations about the centroid.
  const double xx = sum_xx - sum_x * sum_x / inliers;
  const double xy = sum_xy - sum_x * sum_y / inliers;
  const double yy = sum_yy - sum_y * sum_y / inliers;
  const double xd = sum_xd - sum_x * sum_d / inliers;
  const double yd = sum_yd - sum_y * sum_d / inliers;
  const double determinant = xx * yy - xy * xy;
  Plane fitted;
  fitted.a = (xd * yy - yd * xy) / determinant;
  fitted.b = (yd * xx - xd * xy) / determinant;
  fitted.c = (sum_d - fitted.a * sum_x - fitted.b * sum_y) / inliers;
  if (withinSlopes(fitted, parameters)) plane = fitted;
  return inliers;
}

}  // namespace

SegmentPlane fitPlane(const cv::Mat& disparity, const DisparityRange& range, RunSpan runs, std::uint64_t seed,
                      const PlaneRefinementParameters& parameters) {
  SegmentPlane result;
  result.pixels = countPixels(runs);
  result.valid = countValid(disparity, range, runs);
  // The quotient, not the product with pixels: 3 of 10 then reach a fraction of 0.3 exactly.
  const double valid_fraction = static_cast<double>(result.valid) / result.pixels;
  if (result.valid < parameters.min_valid_points || valid_fraction < parameters.min_valid_fraction) {
    result.status = PlaneStatus::TOO_FEW_POINTS;
    return result;
  }

  Random random(seed);
  Sample sample;
  drawSample(disparity, range, runs, result.valid, random, sample);

  Plane best;
  int most_inliers = 0;
  int required = parameters.max_iterations + 1;
  for (; result.iterations < parameters.max_iterations; ++result.iterations) {
    if (result.iterations >= MIN_TRIALS && result.iterations / TRIALS_FACTOR >= required) break;
    Plane plane;
    if (!drawPlane(sample, parameters, random, plane)) continue;
    const int inliers = countInliers(sample, plane, parameters.inlier_threshold, most_inliers);
    if (inliers <= most_inliers) continue;
    best = plane;
    most_inliers = inliers;
    required = requiredTrials(static_cast<double>(inliers) / sample.size, parameters);
  }
  if (most_inliers == 0) {
    result.status = PlaneStatus::DEGENERATE;
    return result;
  }
  if (required > parameters.max_iterations) {
    result.status = PlaneStatus::MAX_ITERATIONS;
    return result;
  }

  result.inliers = refit(disparity, range, runs, sample, parameters, best);
  result.a = best.a;
  result.b = best.b;
  result.c = best.c - best.a * sample.origin_x - best.b * sample.origin_y;
  result.status = PlaneStatus::ACCEPTED;
  return result;
}

}  // namespace disparity_refinement
