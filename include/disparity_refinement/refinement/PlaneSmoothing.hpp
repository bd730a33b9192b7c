#pragma once

#include <vector>

#include "disparity_refinement/refinement/SegmentGraph.hpp"
#include "disparity_refinement/refinement/SegmentRuns.hpp"
#include "disparity_refinement/refinement/SegmentSupport.hpp"

namespace disparity_refinement {

/// Parameters of smoothPlanes().
struct PlaneSmoothingParameters {
  /// Times that all planes are fitted, >= 0; 0: they stay as they are.
  int sweeps = 3;
  /// Largest distance of a measured disparity that takes part [px], > 0.
  double inlier_threshold = 1.5;
  /// Weight of a pixel of border against a pixel of support, >= 0. Larger: smoother hinges.
  double border_weight = 3.0;
  /// Step at a border from which on the neighbour is on another surface [px], > 0.
  double max_step = 3.0;
};

/// Fits the planes anew, each to its own support and to its neighbours' planes along the borders, so that
/// what is one surface has no steps between its segments.
///
/// Least squares, one segment after the other with the present planes of the others (Gauss-Seidel). A point
/// of a border counts border_weight * weight * (1 - (step / max_step)^2)^2, and nothing from max_step on. The
/// plane as it was counts a little over the extent of the segment, which keeps the equations regular.
void smoothPlanes(const SegmentRuns& segments, const SegmentGraph& graph,
                  const std::vector<SegmentSupport>& support, const PlaneSmoothingParameters& parameters,
                  std::vector<DisparityPlane>& planes);

}  // namespace disparity_refinement
