#pragma once

#include <opencv2/core.hpp>

#include "disparity_refinement/matching/CensusSgm.hpp"

namespace disparity_refinement {
namespace straightforward {

/// The 16 census bits of every pixel, CV_16UC1: those of an upper row of the window are lower bits, and
/// within a row those of a left pixel.
cv::Mat censusBits(const cv::Mat& gray);

/// 0 ... 15, CV_8UC1.
cv::Mat censusSlope(const cv::Mat& gray);

/// Semi-global matching as CensusSgm has it, from its definition: the costs of all pixels and disparities,
/// the values of one path after the other, their sums, and what is read from the sums, each in a volume of
/// its own.
///
/// - Cost of a pair of pixels: differing census bits plus difference of the slopes; 10 where the right one is
///   outside of its image.
/// - Cost of a pixel and a disparity: half of the pair's cost and half of the mean of those of the pixels to
///   the left and right, each rounded upwards; at the border the pixel itself for the neighbour. With
///   aggregate_rows the same again of these costs, with those above and below. A path begins with the cost.
/// - A sum counts 255 at most.
/// - A disparity is ambiguous if uniqueness_ratio > 0 and any disparity that is not next to it has the same
///   sum, or one with sum (100 - uniqueness_ratio) < 100 times the least sum.
/// - The right view has for every pixel the least of the sums that belong to it in the left view.
/// - The fraction of a disparity is where two lines of opposite slope through its sum and those beside it
///   meet, to the nearest 1/16, upwards in the middle; 0 for the first and the last disparity.
/// - What is ambiguous, outside or fails the left-right check is in the medians of its neighbours still.
cv::Mat matchCensus(const cv::Mat& left, const cv::Mat& right, const CensusSgmParameters& parameters);

}  // namespace straightforward
}  // namespace disparity_refinement
