#include "disparity_refinement/DisparityRange.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {

void validate(const DisparityRange& range) {
  requireArgument(std::isfinite(range.min) && range.invalid() < range.min, "range.min", range.min,
                  "a finite number, of less than 2^24 in size");
  if (!(std::isfinite(range.max) && range.max >= range.min)) {
    requireArgument(false, "range.max", range.max,
                    "a finite number, at least range.min, " + std::to_string(range.min));
  }
}

void copyValid(const cv::Mat& disparity, const DisparityRange& range, cv::Mat& copy) {
  copy.create(disparity.size(), CV_32FC1);
  const float lowest = range.min, largest = std::numeric_limits<float>::max(), invalid = range.invalid();
  const int threads = std::max(1, cv::getNumThreads());
  forEachStrip(threads, [&](int i) {
    const cv::Range rows = stripOf(disparity.rows, i, threads);
    for (int y = rows.start; y < rows.end; ++y) {
      const float* from = disparity.ptr<float>(y);
      float* to = copy.ptr<float>(y);
      for (int x = 0; x < disparity.cols; ++x) {
        const float finite = from[x] <= largest ? from[x] : invalid;
        to[x] = finite >= lowest ? finite : invalid;
      }
    }
  });
}

void keepOneInvalid(cv::Mat& disparity, const DisparityRange& range) {
  for (int y = 0; y < disparity.rows; ++y) {
    const float* row = disparity.ptr<float>(y);
    if (!std::all_of(row, row + disparity.cols, [&range](float d) { return range.isValid(d); })) return;
  }
  if (!disparity.empty()) disparity.at<float>(0, 0) = range.invalid();
}

}  // namespace disparity_refinement
