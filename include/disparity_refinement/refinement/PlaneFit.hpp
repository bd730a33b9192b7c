#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/PlaneRefinementParameters.hpp"
#include "disparity_refinement/refinement/SegmentPoints.hpp"
#include "disparity_refinement/refinement/SegmentRuns.hpp"

namespace disparity_refinement {

/// Fits the plane d = a x + b y + c to the disparities of one segment by RANSAC, and decides conditions 2 and
/// 3 of PlaneRefinementParameters.
///
/// A trial lays a plane through three points drawn at random; its score is the number of inliers among at
/// most 256 points spread over the segment. There are four times as many trials as the stopping rule asks
/// for, at least 30, but never more than max_iterations. The best plane is then fitted to its inliers among
/// all points by least squares.
///
/// @param disparity   CV_32FC1 [px], finite where range.isValid.
/// @param seed        Of the random numbers; the same seed and points give the same bits on every machine.
/// @param parameters  Valid ones.
/// @param points      Buffers; the points of the segment afterwards, unless it has no pixel.
SegmentPlane fitPlane(const cv::Mat& disparity, const DisparityRange& range, RunSpan runs, std::uint64_t seed,
                      const PlaneRefinementParameters& parameters, SegmentPoints& points);

}  // namespace disparity_refinement
