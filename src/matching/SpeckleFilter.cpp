#include "disparity_refinement/matching/SpeckleFilter.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {

int SpeckleFilter::find(int run) {
  while (runs_[run].link >= 0) {
    const int next = runs_[run].link;
    if (runs_[next].link >= 0) runs_[run].link = runs_[next].link;
    run = next;
  }
  return run;
}

void SpeckleFilter::join(int a, int b) {
  a = find(a);
  b = find(b);
  if (a == b) return;
  if (runs_[a].link > runs_[b].link) std::swap(a, b);  // a is the larger one.
  runs_[a].link += runs_[b].link;
  runs_[b].link = a;
}

void SpeckleFilter::apply(cv::Mat& map, short invalid, int max_size, int max_difference) {
  requireImage(map, "map", CV_16SC1);
  const int width = map.cols, height = map.rows;
  runs_.clear();
  runs_.reserve(map.total());
  row_begin_.assign(1, 0);
  row_begin_.reserve(height + 1);
  const auto are_joined = [=](short a, short b) { return std::abs(a - b) <= max_difference; };

  for (int y = 0; y < height; ++y) {
    const short* row = map.ptr<short>(y);
    const short* row_above = y > 0 ? map.ptr<short>(y - 1) : nullptr;
    int above = y > 0 ? row_begin_[y - 1] : 0;
    const int above_end = row_begin_[y];
    for (int end = 0; end < width;) {
      const int begin = end++;
      if (row[begin] == invalid) continue;
      while (end < width && row[end] != invalid && are_joined(row[end], row[end - 1])) ++end;
      const int run = static_cast<int>(runs_.size());
      runs_.push_back({begin, end, begin - end});

      while (above < above_end && runs_[above].end <= begin) ++above;
      for (int other = above; other < above_end && runs_[other].begin < end; ++other) {
        const int common_end = std::min(end, runs_[other].end);
        int x = std::max(begin, runs_[other].begin);
        while (x < common_end && !are_joined(row[x], row_above[x])) ++x;
        if (x < common_end) join(run, other);
      }
    }
    row_begin_.push_back(static_cast<int>(runs_.size()));
  }

  for (int y = 0; y < height; ++y) {
    short* row = map.ptr<short>(y);
    for (int run = row_begin_[y]; run < row_begin_[y + 1]; ++run) {
      const int size = -runs_[find(run)].link;
      if (size <= max_size) std::fill(row + runs_[run].begin, row + runs_[run].end, invalid);
    }
  }
}

}  // namespace disparity_refinement
