#include "disparity_refinement/StereoGeometry.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace disparity_refinement {
namespace {

bool isPositive(double value) { return value > 0.0 && std::isfinite(value); }

}  // namespace

StereoGeometry stereoGeometry(const ProjectionMatrix& left, const ProjectionMatrix& right) {
  if (!isPositive(left[0]) || !isPositive(right[0])) {
    std::ostringstream text;
    text << "the focal length P[0] is " << left[0] << " (left) and " << right[0]
         << " (right), expected positive values: are the cameras calibrated?";
    throw std::invalid_argument(text.str());
  }
  StereoGeometry geometry;
  geometry.focal_length = left[0];
  geometry.baseline = (left[3] - right[3]) / left[0];
  geometry.principal_point_offset = left[2] - right[2];
  if (!isPositive(geometry.baseline)) {
    std::ostringstream text;
    text << "the baseline (P_left[3] - P_right[3]) / f = (" << left[3] << " - " << right[3] << ") / "
         << left[0] << " is not positive: P_right[3] should be -f * T; are left and right swapped?";
    throw std::invalid_argument(text.str());
  }
  if (!(std::abs(geometry.principal_point_offset) <= MAX_PRINCIPAL_POINT_OFFSET)) {
    std::ostringstream text;
    text << "the principal points P[2] are " << left[2] << " (left) and " << right[2]
         << " (right), expected finite values at most " << MAX_PRINCIPAL_POINT_OFFSET << " px apart";
    throw std::invalid_argument(text.str());
  }
  return geometry;
}

}  // namespace disparity_refinement
