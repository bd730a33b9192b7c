#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace disparity_refinement {

/// A picture with a title above it.
struct Panel {
  std::string title;
  cv::Mat picture;  ///< CV_8UC1 or CV_8UC3 (BGR)
};

/// Panels side by side, row after row, as one CV_8UC3 picture. All pictures have the size of the first and
/// are not empty; throws std::invalid_argument otherwise, and if there are none or columns < 1.
cv::Mat arrangePanels(const std::vector<Panel>& panels, int columns);

}  // namespace disparity_refinement
