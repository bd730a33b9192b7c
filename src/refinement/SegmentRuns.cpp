#include "disparity_refinement/refinement/SegmentRuns.hpp"

#include <cstddef>
#include <numeric>
#include <stdexcept>
#include <string>

namespace disparity_refinement {
namespace {

// Calls visit(run, label) for every run of a label that is not negative, in raster order.
template <typename Visitor>
void forEachRun(const cv::Mat& labels, Visitor visit) {
  for (int y = 0; y < labels.rows; ++y) {
    const int* row = labels.ptr<int>(y);
    for (int x = 0; x < labels.cols;) {
      const int begin = x;
      const int label = row[begin];
      while (x < labels.cols && row[x] == label) ++x;
      if (label >= 0) visit(Run{y, begin, x}, label);
    }
  }
}

}  // namespace

void SegmentRuns::build(const cv::Mat& labels) {
  // Counting sort. first_run_[label + 2] counts the runs of a label first. After the sum first_run_[label +
  // 1] is where the label's next run goes, and in the end it is where the runs of label + 1 begin.
  first_run_.assign(2, 0);
  forEachRun(labels, [&](const Run& run, int label) {
    const std::size_t size = static_cast<std::size_t>(label) + 3;
    if (size > first_run_.size()) {
      // There are at most as many segments as pixels; a larger label would only cost memory.
      if (static_cast<std::size_t>(label) >= labels.total()) {
        throw std::invalid_argument(
            "labels is " + std::to_string(label) + " at x = " + std::to_string(run.x_begin) +
            ", y = " + std::to_string(run.y) + ", expected less than the number of pixels, " +
            std::to_string(labels.total()));
      }
      first_run_.resize(size, 0);
    }
    ++first_run_[label + 2];
  });
  std::partial_sum(first_run_.begin(), first_run_.end(), first_run_.begin());
  runs_.resize(first_run_.back());
  forEachRun(labels, [&](const Run& run, int label) { runs_[first_run_[label + 1]++] = run; });
  first_run_.pop_back();
}

}  // namespace disparity_refinement
