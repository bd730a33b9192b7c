#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace disparity_refinement {

/// Strip i of n of the numbers 0 ... size - 1.
inline cv::Range stripOf(int size, int i, int n) {
  return {static_cast<int>(std::int64_t{size} * i / n), static_cast<int>(std::int64_t{size} * (i + 1) / n)};
}

/// Calls work(i) for the strips i = 0 ... n - 1, side by side if OpenCV has the threads.
template <typename Work>
void forEachStrip(int n, const Work& work) {
  if (n == 1) {
    work(0);
    return;
  }
  cv::parallel_for_(
      cv::Range(0, n),
      [&work](const cv::Range& part) {
        for (int i = part.start; i < part.end; ++i) work(i);
      },
      n);
}

}  // namespace disparity_refinement
