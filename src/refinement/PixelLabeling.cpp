#include "disparity_refinement/refinement/PixelLabeling.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <opencv2/core/hal/intrin.hpp>

#include "disparity_refinement/buffers.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {
namespace {

using cv::v_int16x8;
using cv::v_uint16x8;

// Candidates of a pixel, one vector of them; the last one may be the measured disparity.
constexpr int CANDIDATES = 8;
constexpr int MAX_PLANES = CANDIDATES - 1;
constexpr int USUAL_BORDERS = 256;  // Of a segment; more are an allocation now and then.
constexpr int STEPS = 16;           // Of a pixel, in disparities and costs.
// Planes, or plane and measured disparity, that are nearer are the same [px].
constexpr float SAME = 0.5F;
// Cost of what is no candidate: more than any path adds up to.
constexpr short NO_CANDIDATE = 16384;
constexpr float LARGEST_DISPARITY = 32767.0F;  // In steps.
// Weights of steps are multiples of 1 / 256.
constexpr int WEIGHT_SHIFT = 8;

short inSteps(double value) { return static_cast<short>(std::lround(value * STEPS)); }

// A segment's first candidates.
struct Planes {
  std::array<DisparityPlane, MAX_PLANES> plane;
  int size = 0;

  // Unless there is one like it within the rectangle.
  void add(const DisparityPlane& added, const cv::Rect& box) {
    if (!added.is_known || size == MAX_PLANES) return;
    for (int i = 0; i < size; ++i) {
      double largest = 0.0;
      for (const int x : {box.x, box.x + box.width - 1}) {
        for (const int y : {box.y, box.y + box.height - 1}) {
          largest = std::max(largest, std::abs(added.at(x, y) - plane[i].at(x, y)));
        }
      }
      if (largest < SAME) return;
    }
    plane[size++] = added;
  }
};

// Cost of a plane where something was measured, and where not.
struct PlaneCost {
  short with_measured, in_hole;
};

// The planes that are candidates on pixels x_begin ... x_end - 1 of a row.
class Stretch {
 public:
  Stretch(int y, int x_begin, int x_end, float min_disparity)
      : y_(y), x_begin_(x_begin), x_last_(x_end - 1), min_disparity_(min_disparity) {
    with_measured_.fill(NO_CANDIDATE);
    in_hole_.fill(NO_CANDIDATE);
  }

  int size() const { return size_; }

  // Unless there is one like it.
  void add(const DisparityPlane& plane, const PlaneCost& cost) {
    if (!plane.is_known || size_ == MAX_PLANES) return;
    const double begin = plane.at(x_begin_, y_), last = plane.at(x_last_, y_);
    for (int i = 0; i < size_; ++i) {
      if (std::abs(begin - begin_[i]) < SAME && std::abs(last - last_[i]) < SAME) return;
    }
    begin_[size_] = begin;
    last_[size_] = last;
    first_[size_] = static_cast<float>((begin - min_disparity_) * STEPS);
    slope_[size_] = static_cast<float>(plane.a * STEPS);
    with_measured_[size_] = cost.with_measured;
    in_hole_[size_] = cost.in_hole;
    ++size_;
  }

  // In steps, at the first pixel and from one to the next, of four planes: coordinates relative to the first
  // pixel are small enough for single precision.
  cv::v_float32x4 first(int plane) const { return cv::v_load(&first_[plane]); }
  cv::v_float32x4 slope(int plane) const { return cv::v_load(&slope_[plane]); }
  v_int16x8 costsWithMeasured() const { return cv::v_load(with_measured_.data()); }
  v_int16x8 costsInHole() const { return cv::v_load(in_hole_.data()); }

 private:
  int y_, x_begin_, x_last_;
  float min_disparity_;
  int size_ = 0;
  std::array<double, MAX_PLANES> begin_, last_;
  std::array<float, CANDIDATES> first_{}, slope_{};
  std::array<short, CANDIDATES> with_measured_, in_hole_;
};

// Where the first label of any further segmentation changes after x, at the latest the end of the run.
int endOfStretch(const std::vector<FurtherPlanes>& further, const Run& run, int x) {
  int end = run.x_end;
  for (const FurtherPlanes& other : further) {
    const int* label = other.labels->ptr<int>(run.y);
    int other_end = x + 1;
    while (other_end < end && label[other_end] == label[x]) ++other_end;
    end = other_end;
  }
  return end;
}

// Where the right image shows what is in column x at disparity d; -1 outside of it.
int columnInRight(int x, float d, int columns) {
  const float column = std::floor(static_cast<float>(x) - d + 0.5F);
  return column >= 0.0F && column < static_cast<float>(columns) ? static_cast<int>(column) : -1;
}

cv::Rect boxOf(RunSpan runs) {
  int left = std::numeric_limits<int>::max(), right = 0, top = runs.begin()->y, bottom = top;
  for (const Run& run : runs) {
    left = std::min(left, run.x_begin);
    right = std::max(right, run.x_end);
    bottom = run.y;
  }
  return {left, top, right - left, bottom + 1 - top};
}

// One step of a path. All arrays are of CANDIDATES values. Signed numbers, for SSE2 has no minimum of
// unsigned ones; the costs and their sums along a path are far below 2^15, and sums are cut there.
class Step {
 public:
  explicit Step(const PixelLabelingParameters& p)
      : truncation_(cv::v_setall_s16(inSteps(p.step_truncation))) {
    for (int contrast = 0; contrast < 256; ++contrast) {
      const double weight = p.smoothness * p.half_contrast / (p.half_contrast + contrast);
      weights_[contrast] = static_cast<std::uint16_t>(std::lround(weight * (1 << WEIGHT_SHIFT)));
    }
  }

  void start(const short* costs, short* path, short* sums) const {
    const v_int16x8 cost = cv::v_load(costs);
    cv::v_store(path, cost);
    cv::v_store(sums, cv::v_load(sums) + cost);
  }

  // `path`: the values of the pixel before, which has `number_before` candidates, then those of this one.
  void advance(const short* before, int number_before, const short* disparities, int number,
               const short* costs, int contrast, short* path, short* sums) const {
    if (number < 2) {  // Nothing to choose: less the least one, its value is 0.
      path[0] = 0;
      return;
    }
    const v_int16x8 here = cv::v_load(disparities);
    const v_uint16x8 weight = cv::v_setall_u16(weights_[contrast]);
    v_int16x8 best = cv::v_setall_s16(std::numeric_limits<short>::max());
    for (int j = 0; j < number_before; ++j) {
      // Disparities are not negative: their difference is a positive 16-bit number.
      const v_int16x8 distance = cv::v_reinterpret_as_s16(cv::v_absdiff(here, cv::v_setall_s16(before[j])));
      const v_uint16x8 step = cv::v_reinterpret_as_u16(cv::v_min(distance, truncation_));
      const v_uint16x8 step_cost = cv::v_mul_wrap(step, weight) >> WEIGHT_SHIFT;
      best = cv::v_min(best, cv::v_setall_s16(path[j]) + cv::v_reinterpret_as_s16(step_cost));
    }
    if (number_before == 0) best = cv::v_setzero_s16();
    const v_int16x8 value = cv::v_load(costs) + best;
    const v_int16x8 relative = value - cv::v_setall_s16(cv::v_reduce_min(value));
    cv::v_store(path, relative);
    cv::v_store(sums, cv::v_load(sums) + relative);
  }

 private:
  v_int16x8 truncation_;
  std::array<std::uint16_t, 256> weights_;
};

// 2^(-x / half) for x = 0, 1, 2..., down to a millionth; between the powers of 2 on straight lines, which all
// machines draw alike.
void findHalvings(int half, std::vector<float>& weights) {
  constexpr int HALVINGS = 20;
  weights.clear();
  for (int k = 0; k < HALVINGS; ++k) {
    const float power = 1.0F / static_cast<float>(1 << k);
    for (int i = 0; i < half; ++i) {
      weights.push_back(power * (1.0F - 0.5F * static_cast<float>(i) / static_cast<float>(half)));
    }
  }
}

}  // namespace

void PixelLabeling::mirror(const cv::Mat& measured, const DisparityRange& range, int strips) {
  right_.create(measured.size(), CV_32FC1);
  forEachStrip(strips, [&](int i) {
    const cv::Range rows = stripOf(measured.rows, i, strips);
    for (int y = rows.start; y < rows.end; ++y) {
      const float* d = measured.ptr<float>(y);
      float* right = right_.ptr<float>(y);
      std::fill(right, right + measured.cols, std::numeric_limits<float>::infinity());
      for (int x = 0; x < measured.cols; ++x) {
        if (!range.isValid(d[x])) continue;
        const int column = columnInRight(x, d[x], measured.cols);
        if (column < 0) continue;
        float& seen = right[column];
        // The nearest hides the others.
        if (seen == std::numeric_limits<float>::infinity() || seen < d[x]) seen = d[x];
      }
    }
  });
}

// What is invalid is less than every disparity.
void PixelLabeling::findNearest(const cv::Mat& measured, int reach, int strips) {
  nearest_in_row_.create(measured.size(), CV_32FC1);
  nearest_.create(measured.size(), CV_32FC1);
  const int rows = measured.rows, cols = measured.cols;
  forEachStrip(strips, [&](int i) {
    const cv::Range part = stripOf(rows, i, strips);
    for (int y = part.start; y < part.end; ++y) {
      const float* d = measured.ptr<float>(y);
      float* nearest = nearest_in_row_.ptr<float>(y);
      std::copy(d, d + cols, nearest);
      for (int offset = 1; offset <= std::min(reach, cols - 1); ++offset) {
        for (int x = 0; x < cols - offset; ++x) nearest[x] = std::max(nearest[x], d[x + offset]);
        for (int x = offset; x < cols; ++x) nearest[x] = std::max(nearest[x], d[x - offset]);
      }
    }
  });
  forEachStrip(strips, [&](int i) {
    const cv::Range part = stripOf(rows, i, strips);
    for (int y = part.start; y < part.end; ++y) {
      float* nearest = nearest_.ptr<float>(y);
      const int first = std::max(y - reach, 0), last = std::min(y + reach, rows - 1);
      std::copy_n(nearest_in_row_.ptr<float>(first), cols, nearest);
      for (int other = first + 1; other <= last; ++other) {
        const float* row = nearest_in_row_.ptr<float>(other);
        for (int x = 0; x < cols; ++x) nearest[x] = std::max(nearest[x], row[x]);
      }
    }
  });
}

void PixelLabeling::findCandidates(const cv::Mat& measured, const DisparityRange& range,
                                   const SegmentRuns& segments, const SegmentGraph& graph,
                                   const std::vector<DisparityPlane>& all_planes,
                                   const std::vector<FurtherPlanes>& further,
                                   const PixelLabelingParameters& p, int label, Strip& strip) {
  const RunSpan runs = segments[label];
  if (runs.begin() == runs.end()) return;
  const cv::Rect box = boxOf(runs);
  Planes planes;
  planes.add(all_planes[label], box);
  const int own_planes = planes.size;
  const SegmentGraph::Borders borders = graph.bordersOf(label);
  growTo(strip.borders, borders.end() - borders.begin(), USUAL_BORDERS);
  strip.borders.assign(borders.begin(), borders.end());
  std::sort(strip.borders.begin(), strip.borders.end(), [](const auto& a, const auto& b) {
    return a.length() != b.length() ? a.length() > b.length() : a.neighbour < b.neighbour;
  });
  for (const SegmentGraph::Border& border : strip.borders) planes.add(all_planes[border.neighbour], box);

  const PlaneCost free{0, 0};
  const PlaneCost further_cost{inSteps(p.further_cost), inSteps(p.further_cost_in_hole)};
  const PlaneCost neighbour_cost{inSteps(p.neighbour_cost), inSteps(p.neighbour_cost_in_hole)};
  const short measured_cost = inSteps(p.measured_cost), visibility_cost = inSteps(p.visibility_cost);
  const v_uint16x8 truncation = cv::v_setall_u16(static_cast<std::uint16_t>(inSteps(p.data_truncation)));
  const auto weightOf = [](double weight) {
    return cv::v_setall_u16(static_cast<std::uint16_t>(std::lround(weight * (1 << WEIGHT_SHIFT))));
  };
  const v_uint16x8 data_weight = weightOf(p.data_weight),
                   edge_weight = weightOf(p.edge_share * p.data_weight);
  const float edge_step = static_cast<float>(p.edge_step);
  const float largest = std::min((range.max - range.min) * STEPS, LARGEST_DISPARITY);
  const cv::v_float32x4 zero = cv::v_setzero_f32(), end = cv::v_setall_f32(largest);

  for (const Run& run : runs) {
    const float* d = measured.ptr<float>(run.y);
    const float *right = right_.ptr<float>(run.y), *nearest = nearest_.ptr<float>(run.y);
    short* disparities = disparities_.ptr<short>(run.y);
    short* costs = costs_.ptr<short>(run.y);
    std::uint8_t* numbers = numbers_.ptr<std::uint8_t>(run.y);
    for (int x_begin = run.x_begin, x_end = 0; x_begin < run.x_end; x_begin = x_end) {
      x_end = endOfStretch(further, run, x_begin);
      Stretch stretch(run.y, x_begin, x_end, range.min);
      const auto add = [&](const DisparityPlane& plane, const PlaneCost& cost) {
        stretch.add(plane, stretch.size() == 0 ? free : cost);
      };
      for (int i = 0; i < own_planes; ++i) add(planes.plane[i], free);
      for (const FurtherPlanes& other : further) {
        const int other_label = other.labels->at<int>(run.y, x_begin);
        if (other_label >= 0) add((*other.planes)[other_label], further_cost);
      }
      for (int i = own_planes; i < planes.size; ++i) add(planes.plane[i], neighbour_cost);
      const cv::v_float32x4 first_low = stretch.first(0), first_high = stretch.first(4);
      const cv::v_float32x4 slope_low = stretch.slope(0), slope_high = stretch.slope(4);
      const v_int16x8 with_measured = stretch.costsWithMeasured(), in_hole = stretch.costsInHole();
      for (int x = x_begin; x < x_end; ++x) {
        const cv::v_float32x4 offset = cv::v_setall_f32(static_cast<float>(x - x_begin));
        const cv::v_float32x4 low = cv::v_min(cv::v_max(first_low + slope_low * offset, zero), end);
        const cv::v_float32x4 high = cv::v_min(cv::v_max(first_high + slope_high * offset, zero), end);
        const v_int16x8 planes_here = cv::v_pack(cv::v_round(low), cv::v_round(high));
        short* candidate = disparities + x * CANDIDATES;
        short* cost = costs + x * CANDIDATES;
        cv::v_store(candidate, planes_here);
        int n = stretch.size();
        if (range.isValid(d[x])) {
          const float value = std::min((d[x] - range.min) * STEPS, LARGEST_DISPARITY);
          const short own = static_cast<short>(std::floor(value + 0.5F));
          const v_uint16x8 distance =
              cv::v_min(cv::v_absdiff(planes_here, cv::v_setall_s16(own)), truncation);
          const v_uint16x8 weight = nearest[x] - d[x] > edge_step ? edge_weight : data_weight;
          const v_uint16x8 distance_cost = cv::v_mul_wrap(distance, weight) >> WEIGHT_SHIFT;
          cv::v_store(cost, with_measured + cv::v_reinterpret_as_s16(distance_cost));
          if (n == 0 || std::abs(candidate[0] - own) > SAME * STEPS) {
            candidate[n] = own;
            cost[n] = measured_cost;
            ++n;
          }
        } else {
          cv::v_store(cost, in_hole);
        }
        numbers[x] = static_cast<std::uint8_t>(n);
        if (n < 2) continue;
        for (int i = 0; i < n; ++i) {
          const float at = range.min + static_cast<float>(candidate[i]) / STEPS;
          const int column = columnInRight(x, at, measured.cols);
          if (column >= 0 && right[column] < at - 1.0F)
            cost[i] = static_cast<short>(cost[i] + visibility_cost);
        }
      }
    }
  }
}

void PixelLabeling::addPaths(const cv::Mat& gray, const PixelLabelingParameters& p, int strips) {
  const Step step(p);
  const int rows = gray.rows, cols = gray.cols;
  forEachStrip(strips, [&](int i) {
    const cv::Range part = stripOf(rows, i, strips);
    std::array<short, CANDIDATES> path;
    for (int y = part.start; y < part.end; ++y) {
      const short* disparities = disparities_.ptr<short>(y);
      const auto* costs = costs_.ptr<short>(y);
      auto* sums = sums_.ptr<short>(y);
      const auto *numbers = numbers_.ptr<std::uint8_t>(y), *value = gray.ptr<std::uint8_t>(y);
      std::fill(sums, sums + cols * CANDIDATES, short{0});
      const auto walk = [&](int first, int end, int direction) {
        step.start(costs + first * CANDIDATES, path.data(), sums + first * CANDIDATES);
        for (int x = first + direction; x != end; x += direction) {
          const int before = x - direction;
          step.advance(disparities + before * CANDIDATES, numbers[before], disparities + x * CANDIDATES,
                       numbers[x], costs + x * CANDIDATES, std::abs(value[x] - value[before]), path.data(),
                       sums + x * CANDIDATES);
        }
      };
      walk(0, cols, 1);
      walk(cols - 1, -1, -1);
    }
  });
  forEachStrip(strips, [&](int i) {
    const cv::Range part = stripOf(cols, i, strips);
    std::vector<short>& paths = strips_[i].path;
    paths.resize(static_cast<std::size_t>(part.size()) * CANDIDATES);
    const auto walk = [&](int first, int end, int direction) {
      for (int y = first; y != end; y += direction) {
        const short* disparities = disparities_.ptr<short>(y);
        const auto* costs = costs_.ptr<short>(y);
        auto* sums = sums_.ptr<short>(y);
        const auto *value = gray.ptr<std::uint8_t>(y), *numbers = numbers_.ptr<std::uint8_t>(y);
        const int before = y == first ? y : y - direction;
        const short* disparities_before = disparities_.ptr<short>(before);
        const auto *numbers_before = numbers_.ptr<std::uint8_t>(before),
                   *value_before = gray.ptr<std::uint8_t>(before);
        for (int x = part.start; x < part.end; ++x) {
          short* path = paths.data() + (x - part.start) * CANDIDATES;
          if (y == first) {
            step.start(costs + x * CANDIDATES, path, sums + x * CANDIDATES);
          } else {
            step.advance(disparities_before + x * CANDIDATES, numbers_before[x], disparities + x * CANDIDATES,
                         numbers[x], costs + x * CANDIDATES, std::abs(value[x] - value_before[x]), path,
                         sums + x * CANDIDATES);
          }
        }
      }
    };
    walk(0, rows, 1);
    walk(rows - 1, -1, -1);
  });
}

void PixelLabeling::choose(const cv::Mat& measured, const DisparityRange& range,
                           const PixelLabelingParameters& p, int strips, cv::Mat& result) const {
  const int reach = inSteps(p.soft_reach);
  forEachStrip(strips, [&](int strip) {
    const cv::Range rows = stripOf(measured.rows, strip, strips);
    for (int y = rows.start; y < rows.end; ++y) {
      const float* d = measured.ptr<float>(y);
      float* out = result.ptr<float>(y);
      const auto* numbers = numbers_.ptr<std::uint8_t>(y);
      for (int x = 0; x < measured.cols; ++x) {
        const short* candidate = disparities_.ptr<short>(y) + x * CANDIDATES;
        const short* sum = sums_.ptr<short>(y) + x * CANDIDATES;
        const int n = numbers[x];
        if (n == 0) {
          out[x] = d[x];
          continue;
        }
        int best = 0;
        for (int i = 1; i < n; ++i) best = sum[i] < sum[best] ? i : best;
        float total = 0.0F, weighted = 0.0F;
        for (int i = 0; i < n; ++i) {
          const std::size_t dearer = sum[i] - sum[best];
          if (std::abs(candidate[i] - candidate[best]) > reach || dearer >= weights_.size()) continue;
          total += weights_[dearer];
          weighted += weights_[dearer] * static_cast<float>(candidate[i]);
        }
        // A step may round beyond the range; what was measured beyond it stays.
        out[x] = std::min(range.min + weighted / total / STEPS, std::max(range.max, d[x]));
      }
    }
  });
}

void PixelLabeling::compute(const cv::Mat& measured, const cv::Mat& gray, const DisparityRange& range,
                            const SegmentRuns& segments, const SegmentGraph& graph,
                            const std::vector<DisparityPlane>& planes,
                            const std::vector<FurtherPlanes>& further,
                            const PixelLabelingParameters& parameters, cv::Mat& result) {
  const int strips = std::max(1, cv::getNumThreads());
  strips_.resize(std::max<std::size_t>(strips_.size(), strips));
  const cv::Size all(measured.cols * CANDIDATES, measured.rows);
  disparities_.create(all, CV_16SC1);
  costs_.create(all, CV_16SC1);
  sums_.create(all, CV_16SC1);
  numbers_.create(measured.size(), CV_8UC1);
  numbers_ = 0;
  // The sums are of four paths.
  findHalvings(std::max(1, 4 * inSteps(parameters.half_cost)), weights_);
  mirror(measured, range, strips);
  findNearest(measured, parameters.edge_reach, strips);
  forEachStrip(strips, [&](int i) {
    const cv::Range part = stripOf(segments.size(), i, strips);
    for (int label = part.start; label < part.end; ++label) {
      findCandidates(measured, range, segments, graph, planes, further, parameters, label, strips_[i]);
    }
  });
  addPaths(gray, parameters, strips);
  choose(measured, range, parameters, strips, result);
}

}  // namespace disparity_refinement
