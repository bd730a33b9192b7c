#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "disparity_refinement/StereoGeometry.hpp"

namespace disparity_refinement {

/// Writes stereo frames with ground truth to a folder in the layout of KITTI's stereo 2012 benchmark: image_0
/// and image_1 (NNNNNN_10.png), disp_noc, calib (NNNNNN.txt). KittiDataset reads it.
class BenchmarkWriter {
 public:
  /// Makes the folder. Throws std::runtime_error unless it is new or empty.
  explicit BenchmarkWriter(const std::string& folder);

  /// @param left, right  CV_8UC1
  /// @param disparity    Ground truth of the left image [px], CV_32FC1, 0 where unknown.
  /// Throws std::runtime_error that names the file.
  void write(const cv::Mat& left, const cv::Mat& right, const cv::Mat& disparity,
             const ProjectionMatrix& left_projection, const ProjectionMatrix& right_projection);

 private:
  std::string folder_;
  int frames_ = 0;
};

}  // namespace disparity_refinement
