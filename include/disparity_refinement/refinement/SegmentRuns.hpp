#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace disparity_refinement {

/// Pixels x_begin ... x_end - 1 of row y, all of one segment [px].
struct Run {
  int y, x_begin, x_end;
};

/// The runs of one segment.
class RunSpan {
 public:
  RunSpan(const Run* begin, const Run* end) : begin_(begin), end_(end) {}
  const Run* begin() const { return begin_; }
  const Run* end() const { return end_; }

 private:
  const Run *begin_, *end_;
};

/// A label map as horizontal runs, sorted by label: a segment is visited without a look at the pixels of the
/// others.
class SegmentRuns {
 public:
  /// @param labels  CV_32SC1; negative labels belong to no segment. Buffers of former label maps are reused.
  /// @throws std::invalid_argument  for a label of at least the number of pixels.
  void build(const cv::Mat& labels);

  /// Largest label + 1.
  int size() const { return static_cast<int>(first_run_.size()) - 1; }

  /// The runs of a label, 0 <= label < size(), in raster order; none for a label that does not occur.
  RunSpan operator[](int label) const {
    return {runs_.data() + first_run_[label], runs_.data() + first_run_[label + 1]};
  }

 private:
  std::vector<int> first_run_ = {0};  // Of every label, and the number of runs at the end.
  std::vector<Run> runs_;
};

}  // namespace disparity_refinement
