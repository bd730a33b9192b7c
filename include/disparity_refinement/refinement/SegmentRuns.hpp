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
  /// @throws std::invalid_argument  for a label of at least the number of pixels; the former runs stay.
  void build(const cv::Mat& labels);

  /// Largest label + 1.
  int size() const { return size_; }

  /// The runs of a label, 0 <= label < size(), in raster order; none for a label that does not occur.
  RunSpan operator[](int label) const {
    return {runs_.data() + first_run_[label], runs_.data() + first_run_[label + 1]};
  }

 private:
  struct LabelledRun {
    Run run;
    int label;
  };

  /// The runs of some rows in raster order, but none of negative labels.
  struct Strip {
    void findRuns(const cv::Mat& labels, const cv::Range& rows);
    const LabelledRun* begin() const { return runs.data(); }
    const LabelledRun* end() const { return runs.data() + size; }

    std::vector<int> starts;  // Of the runs of one row [px].
    std::vector<LabelledRun> runs;
    int size = 0;
  };

  /// Largest label of the strips, -1 without any run.
  int largestLabel(int strips, const cv::Mat& labels) const;
  void sortByLabel(int strips);

  std::vector<Strip> strips_;
  int size_ = 0;
  std::vector<int> first_run_;  // Of every label, and the number of runs at the end.
  std::vector<Run> runs_;
};

}  // namespace disparity_refinement
