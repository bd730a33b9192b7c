#include "disparity_refinement/refinement/SegmentRuns.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <opencv2/core/hal/intrin.hpp>
#include <stdexcept>
#include <string>

#include "disparity_refinement/buffers.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {
namespace {

// Where the runs of a row begin, and where the last one ends. Returns the number of runs.
int findStarts(const int* row, int cols, int* starts) {
  starts[0] = 0;
  int n = 1;
  const auto look = [&](int x) {
    starts[n] = x;
    n += row[x] != row[x - 1] ? 1 : 0;
  };
  int x = 1;
  for (; x <= cols - 4; x += 4) {
    if (cv::v_check_all(cv::v_load(row + x) == cv::v_load(row + x - 1))) continue;
    for (int i = 0; i < 4; ++i) look(x + i);
  }
  for (; x < cols; ++x) look(x);
  starts[n] = cols;
  return n;
}

}  // namespace

void SegmentRuns::Strip::findRuns(const cv::Mat& labels, const cv::Range& rows) {
  size = 0;
  growTo(starts, labels.cols + 1);
  for (int y = rows.start; y < rows.end; ++y) {
    const int* row = labels.ptr<int>(y);
    const int n = findStarts(row, labels.cols, starts.data());
    // Not growTo, for the runs of the rows above stay; resize leaves room for more too.
    const std::size_t needed = static_cast<std::size_t>(size) + n;
    if (runs.size() < needed) runs.resize(needed);
    for (int i = 0; i < n; ++i) {
      const int label = row[starts[i]];
      runs[size] = {{y, starts[i], starts[i + 1]}, label};
      size += label >= 0 ? 1 : 0;
    }
  }
}

int SegmentRuns::largestLabel(int strips, const cv::Mat& labels) const {
  const std::size_t pixels = labels.total();
  int largest = -1;
  for (int i = 0; i < strips; ++i) {
    for (const auto& [run, label] : strips_[i]) {
      // There are at most as many segments as pixels; a larger label would only cost memory.
      if (static_cast<std::size_t>(label) >= pixels) {
        throw std::invalid_argument("labels is " + std::to_string(label) + " at x = " +
                                    std::to_string(run.x_begin) + ", y = " + std::to_string(run.y) +
                                    ", expected less than the number of pixels, " + std::to_string(pixels));
      }
      largest = std::max(largest, label);
    }
  }
  return largest;
}

// Counting sort. first_run_[label + 2] counts the runs of a label first. After the sum first_run_[label + 1]
// is where the label's next run goes, and in the end it is where the runs of label + 1 begin.
void SegmentRuns::sortByLabel(int strips) {
  const std::size_t counters = static_cast<std::size_t>(size_) + 2;
  growTo(first_run_, counters);
  std::fill_n(first_run_.begin(), counters, 0);
  for (int i = 0; i < strips; ++i) {
    for (const auto& labelled : strips_[i]) ++first_run_[labelled.label + 2];
  }
  std::partial_sum(first_run_.begin(), first_run_.begin() + counters, first_run_.begin());
  growTo(runs_, first_run_[counters - 1]);
  for (int i = 0; i < strips; ++i) {
    for (const auto& labelled : strips_[i]) runs_[first_run_[labelled.label + 1]++] = labelled.run;
  }
}

void SegmentRuns::build(const cv::Mat& labels) {
  const int strips = std::max(1, std::min(cv::getNumThreads(), labels.rows));
  if (strips_.size() < static_cast<std::size_t>(strips)) strips_.resize(strips);
  forEachStrip(strips, [&](int i) { strips_[i].findRuns(labels, stripOf(labels.rows, i, strips)); });
  size_ = largestLabel(strips, labels) + 1;
  sortByLabel(strips);
}

}  // namespace disparity_refinement
