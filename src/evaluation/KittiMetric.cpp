#include "disparity_refinement/evaluation/KittiMetric.hpp"

#include <algorithm>
#include <cmath>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

// The devkit's value of a pixel that is still without disparity after the interpolation.
constexpr float DEVKIT_INVALID = -1.0F;

void interpolateRow(float* row, int width, const DisparityRange& range) {
  int last_valid = -1;
  for (int x = 0; x < width; ++x) {
    if (!range.isValid(row[x])) continue;
    const float background = last_valid < 0 ? row[x] : std::min(row[last_valid], row[x]);
    std::fill(row + last_valid + 1, row + x, background);
    last_valid = x;
  }
  if (last_valid >= 0) std::fill(row + last_valid + 1, row + width, row[last_valid]);
}

void extrapolateColumn(cv::Mat& disparity, int x, const DisparityRange& range) {
  int first = 0, last = disparity.rows - 1;
  while (first <= last && !range.isValid(disparity.at<float>(first, x))) ++first;
  if (first > last) return;
  while (!range.isValid(disparity.at<float>(last, x))) --last;
  for (int y = 0; y < first; ++y) disparity.at<float>(y, x) = disparity.at<float>(first, x);
  for (int y = last + 1; y < disparity.rows; ++y) disparity.at<float>(y, x) = disparity.at<float>(last, x);
}

/// Collects the errors of the pixels of one map.
struct ErrorSum {
  DisparityErrors sum;
  int pixels = 0;

  void add(float error) {
    for (std::size_t i = 0; i < sum.outliers.size(); ++i)
      if (error > static_cast<float>(i + 1)) sum.outliers[i] += 1.0;
    sum.end_point_error += error;
    ++pixels;
  }

  DisparityErrors mean() const {
    DisparityErrors mean = sum;
    const double divisor = std::max(pixels, 1);
    for (double& outliers : mean.outliers) outliers /= divisor;
    mean.end_point_error /= divisor;
    return mean;
  }
};

void accumulate(DisparityErrors& sum, const DisparityErrors& errors, double weight) {
  for (std::size_t i = 0; i < sum.outliers.size(); ++i) sum.outliers[i] += weight * errors.outliers[i];
  sum.end_point_error += weight * errors.end_point_error;
}

void accumulate(KittiScore& sum, const KittiScore& score, double weight) {
  accumulate(sum.all, score.all, weight);
  accumulate(sum.est, score.est, weight);
  sum.density += weight * score.density;
}

}  // namespace

void interpolateBackground(cv::Mat& disparity, const DisparityRange& range) {
  requireImage(disparity, "disparity", CV_32FC1);
  for (int y = 0; y < disparity.rows; ++y) interpolateRow(disparity.ptr<float>(y), disparity.cols, range);
  for (int x = 0; x < disparity.cols; ++x) extrapolateColumn(disparity, x, range);
}

KittiScore scoreDisparity(const cv::Mat& disparity, const DisparityRange& range,
                          const cv::Mat& ground_truth) {
  requireImage(disparity, "disparity", CV_32FC1);
  requireImage(ground_truth, "ground_truth", CV_32FC1, disparity.size());

  cv::Mat interpolated = disparity.clone();
  interpolateBackground(interpolated, range);

  ErrorSum all, est;
  for (int y = 0; y < disparity.rows; ++y) {
    for (int x = 0; x < disparity.cols; ++x) {
      const float truth = ground_truth.at<float>(y, x);
      if (!(truth > 0.0F)) continue;
      const float d = interpolated.at<float>(y, x);
      const float error = std::abs(truth - (range.isValid(d) ? d : DEVKIT_INVALID));
      all.add(error);
      if (range.isValid(disparity.at<float>(y, x))) est.add(error);
    }
  }
  if (all.pixels == 0)
    throw std::invalid_argument("ground_truth has no pixel above 0, expected at least one");

  KittiScore score;
  score.all = all.mean();
  score.est = est.mean();
  score.density = static_cast<double>(est.pixels) / all.pixels;
  return score;
}

void KittiScoreMean::add(const KittiScore& score) {
  accumulate(sum_, score, 1.0);
  ++count_;
}

KittiScore KittiScoreMean::mean() const {
  KittiScore mean;
  if (count_ > 0) accumulate(mean, sum_, 1.0 / count_);
  return mean;
}

}  // namespace disparity_refinement
