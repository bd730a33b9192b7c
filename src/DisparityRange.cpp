#include "disparity_refinement/DisparityRange.hpp"

#include <algorithm>

namespace disparity_refinement {

void keepOneInvalid(cv::Mat& disparity, const DisparityRange& range) {
  for (int y = 0; y < disparity.rows; ++y) {
    const float* row = disparity.ptr<float>(y);
    if (!std::all_of(row, row + disparity.cols, [&range](float d) { return range.isValid(d); })) return;
  }
  if (!disparity.empty()) disparity.at<float>(0, 0) = range.invalid();
}

}  // namespace disparity_refinement
