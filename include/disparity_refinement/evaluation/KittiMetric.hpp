#pragma once

#include <array>
#include <opencv2/core.hpp>

#include "disparity_refinement/DisparityRange.hpp"

namespace disparity_refinement {

/// Errors of one map, or their mean over maps, as the KITTI 2012 devkit's evaluate_stereo computes them; 0 if
/// there is no pixel to take them over.
struct DisparityErrors {
  /// Share of the ground-truth pixels wrong by more than 1...5 px, 0...1.
  std::array<double, 5> outliers{};
  /// Mean absolute error [px].
  double end_point_error = 0.0;
};

struct KittiScore {
  DisparityErrors all;   ///< Over all ground-truth pixels, after interpolation.
  DisparityErrors est;   ///< Over those that had a disparity before interpolation.
  double density = 0.0;  ///< Share of the ground-truth pixels that had a disparity, 0...1.
};

/// Fills the holes of a map as the devkit does before scoring: per row an interior run of invalid pixels
/// takes the smaller of its two ends, runs at the borders of the row copy the nearest value; then every
/// column copies its first and last valid value outward. Rows without any value between valid rows stay
/// invalid. Throws std::invalid_argument unless the map is CV_32FC1 and not empty.
void interpolateBackground(cv::Mat& disparity, const DisparityRange& range);

/// Scores one map against the ground truth of the same size, both CV_32FC1 [px], the ground truth 0 where
/// unknown. A pixel that the interpolation leaves invalid counts with the devkit's -1 px, whatever value
/// marks it in the map. Throws std::invalid_argument if types or sizes differ or the ground truth is empty
/// everywhere.
KittiScore scoreDisparity(const cv::Mat& disparity, const DisparityRange& range, const cv::Mat& ground_truth);

/// Mean of per-image scores, the data set's figure.
class KittiScoreMean {
 public:
  void add(const KittiScore& score);
  int count() const { return count_; }
  /// All 0 if nothing was added.
  KittiScore mean() const;

 private:
  KittiScore sum_;
  int count_ = 0;
};

}  // namespace disparity_refinement
