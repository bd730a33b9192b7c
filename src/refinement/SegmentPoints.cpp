#include "disparity_refinement/refinement/SegmentPoints.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <opencv2/core/hal/intrin.hpp>

#include "disparity_refinement/buffers.hpp"

namespace disparity_refinement {
namespace {

constexpr float LARGEST = std::numeric_limits<float>::max();

// Runs between the one that is read and the one that is fetched into the cache.
constexpr int PREFETCH_DISTANCE = 8;

// Writes the valid pixels of runs one after the other.
class PointWriter {
 public:
  PointWriter(const DisparityRange& range, int origin_x, int* x, int* y, float* d)
      : min_(range.min), origin_x_(origin_x), x_(x), y_(y), d_(d) {}

  int size() const { return size_; }

  void append(const float* row, int begin, int end, int y) {
    const cv::v_float32x4 min = cv::v_setall_f32(min_), max = cv::v_setall_f32(LARGEST);
    const cv::v_int32x4 steps(0, 1, 2, 3), four_y = cv::v_setall_s32(y);
    int x = begin;
    for (; x <= end - 4; x += 4) {
      const cv::v_float32x4 d = cv::v_load(row + x);
      const int valid = cv::v_signmask((d >= min) & (d <= max));
      if (valid == 0b1111) {
        cv::v_store(x_ + size_, cv::v_setall_s32(x - origin_x_) + steps);
        cv::v_store(y_ + size_, four_y);
        cv::v_store(d_ + size_, d);
        size_ += 4;
      } else if (valid != 0) {
        for (int i = 0; i < 4; ++i) appendPixel(row, x + i, y);
      }
    }
    for (; x < end; ++x) appendPixel(row, x, y);
  }

 private:
  // The next pixel takes the place of one that is not valid: a branch could not be foreseen.
  void appendPixel(const float* row, int x, int y) {
    const float d = row[x];
    x_[size_] = x - origin_x_;
    y_[size_] = y;
    d_[size_] = d;
    size_ += static_cast<int>(d >= min_) & static_cast<int>(d <= LARGEST);
  }

  float min_;
  int origin_x_, size_ = 0;
  int *x_, *y_;
  float* d_;
};

// The runs of a segment are too short for the processor to see where the next ones are.
void prefetch(const cv::Mat& disparity, const Run& run) {
  const float* row = disparity.ptr<float>(run.y);
  __builtin_prefetch(row + run.x_begin);
  __builtin_prefetch(row + run.x_end - 1);
}

}  // namespace

void SegmentPoints::gather(const cv::Mat& disparity, const DisparityRange& range, RunSpan runs) {
  pixels = 0;
  int left = std::numeric_limits<int>::max(), right = 0;
  for (const Run& run : runs) {
    pixels += run.x_end - run.x_begin;
    left = std::min(left, run.x_begin);
    right = std::max(right, run.x_end);
  }
  origin_x = left + (right - left) / 2;
  const int top = runs.begin()->y, bottom = (runs.end() - 1)->y;
  origin_y = top + (bottom - top) / 2;

  const std::size_t capacity = static_cast<std::size_t>(pixels) + PADDING;
  growTo(x, capacity);
  growTo(y, capacity);
  growTo(d, capacity);
  PointWriter points(range, origin_x, x.data(), y.data(), d.data());
  for (const Run* run = runs.begin(); run != runs.end(); ++run) {
    if (runs.end() - run > PREFETCH_DISTANCE) prefetch(disparity, run[PREFETCH_DISTANCE]);
    points.append(disparity.ptr<float>(run->y), run->x_begin, run->x_end, run->y - origin_y);
  }
  size = points.size();
  for (int i = 0; i < PADDING; ++i) {
    x[size + i] = y[size + i] = 0;
    d[size + i] = std::numeric_limits<float>::quiet_NaN();
  }
}

}  // namespace disparity_refinement
