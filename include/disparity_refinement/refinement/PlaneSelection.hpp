#pragma once

#include <vector>

#include "disparity_refinement/refinement/SegmentGraph.hpp"
#include "disparity_refinement/refinement/SegmentSupport.hpp"

namespace disparity_refinement {

/// Parameters of selectPlanes().
struct PlaneSelectionParameters {
  /// Times that all segments choose, >= 0; 0: planes stay as they were fitted.
  int sweeps = 4;
  /// Distance to a measured disparity beyond which it costs no more [px], > 0.
  double data_truncation = 3.0;
  /// Weight of a pixel of border against a pixel of support, >= 0. Larger: planes continue their neighbours'.
  double border_weight = 4.0;
  /// Step at a border beyond which it costs no more [px], > 0: it is a depth step then.
  double border_truncation = 4.0;
};

/// Lets every segment choose among its own plane and those of its neighbours; so planes reach segments that
/// have none of their own.
///
/// A plane's cost is the sum of min(|plane - d|, data_truncation) over the support, and border_weight times
/// the sum of weight * min(|plane - neighbour's plane|, border_truncation) over the points of the borders.
/// The segments choose one after the other, each with the present choices of the others (iterated
/// conditional modes: Besag, J. R. Stat. Soc. B 1986), every second time in reverse order.
///
/// @param fitted  One a segment.
/// @param planes  Those chosen; a vector of its own.
void selectPlanes(const SegmentGraph& graph, const std::vector<SegmentSupport>& support,
                  const PlaneSelectionParameters& parameters, const std::vector<DisparityPlane>& fitted,
                  std::vector<DisparityPlane>& planes);

}  // namespace disparity_refinement
