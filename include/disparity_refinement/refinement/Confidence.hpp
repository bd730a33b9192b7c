#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/PlaneRefinementParameters.hpp"

namespace disparity_refinement {

/// Where a refined disparity comes from, by how far what was measured carries it.
enum class DisparitySource : std::uint8_t {
  NONE = 0,       ///< There is no disparity.
  MEASURED = 1,   ///< A disparity was measured here, at most SAME_SOURCE px away.
  OWN_PLANE = 2,  ///< The plane that was fitted to the segment of the pixel, at most SAME_SOURCE px away.
  NEIGHBOUR_PLANE = 3,  ///< Other planes, though the segment has one of its own.
  FILLED = 4,           ///< Other planes, for none could be fitted to the segment.
};
constexpr int DISPARITY_SOURCES = 5;
constexpr float SAME_SOURCE = 1.0F;  ///< [px]

const char* toString(DisparitySource source);

/// Finds the source of every pixel. It is read off the result, for either mode of DisparityRefinement.
///
/// @param disparity  CV_32FC1: what was measured [px].
/// @param refined    CV_32FC1 of the same size: what was made of it.
/// @param labels     CV_32SC1 of the same size; a negative label has no plane.
/// @param fitted     DisparityRefinement::fittedPlanes() of it, one for every label.
/// @param sources    CV_8UC1 of DisparitySource; written in place if it has that type and size already.
/// @throws std::invalid_argument  for images of another type, empty, or of different size, and a label
///                   without a plane.
void findSources(const cv::Mat& disparity, const cv::Mat& refined, const cv::Mat& labels,
                 const DisparityRange& range, const std::vector<SegmentPlane>& fitted, cv::Mat& sources);

/// Confidence in every disparity, 0...255: 255 times the share of MEASURED among the CONFIDENCE_WINDOW^2
/// pixels around it, where the rim of the image goes on as it is; 0 for NONE. So it is small in large holes,
/// and where the refinement contradicts what was measured.
///
/// @param sources     CV_8UC1 of DisparitySource, not empty. Throws std::invalid_argument otherwise.
/// @param confidence  CV_8UC1 of the same size; written in place if it has that type and size already.
void findConfidence(const cv::Mat& sources, cv::Mat& confidence);
constexpr int CONFIDENCE_WINDOW = 21;  ///< [px]

}  // namespace disparity_refinement
