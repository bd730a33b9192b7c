#pragma once

namespace disparity_refinement {

/// What becomes of a valid disparity that differs from its plane by more than max_divergence.
enum class DivergenceAction { KEEP = 0, INVALIDATE = 1, TAKE_PLANE = 2 };

/// What becomes of a plane's value outside the disparity range: it is not written, or it is moved to the
/// nearer end of the range before the conditions are looked at.
enum class OutOfRangeAction { INVALIDATE = 0, CLAMP = 1 };

/// Parameters of the plane fit and of the four conditions of reprojection (Lima et al., section III-C).
///
/// A pixel takes the value of its segment's plane if all four conditions hold, and keeps what it had if one
/// fails; only condition 4 leaves a choice. Every bound itself belongs to the side that fulfils the
/// condition.
struct PlaneRefinementParameters {
  /// RANSAC: largest distance of an inlier to the plane along d [px], > 0.
  double inlier_threshold = 1.5;
  /// RANSAC: probability of having drawn one sample of inliers only, 0 < confidence < 1.
  double confidence = 0.99;
  /// RANSAC: largest slope of a plane along x and y [px/px], > 0.
  double max_slope_x = 0.9;
  double max_slope_y = 1.5;

  /// Condition 1, per pixel: a disparity error of disparity_error [px] may change the depth by at most
  /// max_depth_error [m]. This bounds the value d to be written, whatever the pixel had before:
  /// d >= sqrt(f * T * disparity_error / max_depth_error). disparity_error = 0: no bound.
  double disparity_error = 1.0 / 16.0;
  double max_depth_error = 2.0;

  /// Condition 2, per segment: least share, 0...1, and least number of pixels with a disparity, >= 3.
  double min_valid_fraction = 0.1;
  int min_valid_points = 12;

  /// Condition 3, per segment: RANSAC meets its stopping rule within this number of trials, >= 1. The rule
  /// asks for the least n with (1 - w^3)^n <= 1 - confidence, w the largest share of inliers found.
  int max_iterations = 100;

  /// Condition 4, per pixel with a disparity: largest |plane - d| that is replaced by the plane [px], >= 0.
  double max_divergence = 3.0;
  DivergenceAction divergence_action = DivergenceAction::KEEP;

  OutOfRangeAction out_of_range_action = OutOfRangeAction::INVALIDATE;
};

/// Throws std::invalid_argument that names the parameter, its value and what is expected.
void validate(const PlaneRefinementParameters& parameters);

/// Why a segment has no plane; ACCEPTED if it has one.
enum class PlaneStatus {
  ACCEPTED = 0,
  TOO_FEW_POINTS = 1,  ///< Condition 2 fails.
  DEGENERATE = 2,      ///< No trial gave a plane within the slopes: the points lie on a line, say.
  MAX_ITERATIONS = 3,  ///< Condition 3 fails.
  OF_NEIGHBOUR = 4,    ///< One of these, but a neighbour's plane is used: RefinementMode::QUALITY.
};

const char* toString(PlaneStatus status);

/// The plane d = a x + (b y + c) of a segment; x, y in pixels of the image, d in px.
struct SegmentPlane {
  double a = 0.0, b = 0.0, c = 0.0;  ///< 0 unless ACCEPTED or OF_NEIGHBOUR.
  int pixels = 0;                    ///< Pixels of the segment; 0 if no pixel has this label.
  int valid = 0;                     ///< Pixels with a disparity: the support.
  int inliers = 0;                   ///< Those of them to which the plane was fitted; 0 unless ACCEPTED.
  int iterations = 0;                ///< RANSAC trials; those that could not win any more count too.
  PlaneStatus status = PlaneStatus::TOO_FEW_POINTS;

  double inlierShare() const { return valid > 0 ? static_cast<double>(inliers) / valid : 0.0; }
};

}  // namespace disparity_refinement
