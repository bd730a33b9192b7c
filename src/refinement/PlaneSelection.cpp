#include "disparity_refinement/refinement/PlaneSelection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "disparity_refinement/buffers.hpp"

namespace disparity_refinement {
namespace {

double supportCost(const SegmentSupport& support, const DisparityPlane& plane, double truncation) {
  const float a = static_cast<float>(plane.a), b = static_cast<float>(plane.b),
              c = static_cast<float>(plane.c), most = static_cast<float>(truncation);
  float sum = 0.0F;
  for (int i = 0; i < support.size; ++i) {
    sum += std::min(std::abs(a * support.x[i] + b * support.y[i] + c - support.d[i]), most);
  }
  return support.weight() * sum;
}

double borderCost(const SegmentGraph& graph, const SegmentGraph::Border& border, const DisparityPlane& plane,
                  const DisparityPlane& neighbour, double truncation) {
  const float a = static_cast<float>(plane.a - neighbour.a), b = static_cast<float>(plane.b - neighbour.b),
              c = static_cast<float>(plane.c - neighbour.c), most = static_cast<float>(truncation);
  float sum = 0.0F;
  int n = 0;
  for (int i = border.first_point; i < border.end_point; i += border.stride(), ++n) {
    const SegmentGraph::BorderPoint& point = graph.point(i);
    sum += point.weight * std::min(std::abs(a * point.x + b * point.y + c), most);
  }
  return static_cast<double>(sum) * border.length() / n;
}

}  // namespace

void selectPlanes(const SegmentGraph& graph, const std::vector<SegmentSupport>& support,
                  const PlaneSelectionParameters& parameters, const std::vector<DisparityPlane>& fitted,
                  std::vector<DisparityPlane>& planes) {
  growTo(planes, fitted.size());
  planes = fitted;
  const int segments = static_cast<int>(planes.size());
  for (int sweep = 0; sweep < parameters.sweeps; ++sweep) {
    for (int i = 0; i < segments; ++i) {
      const int segment = sweep % 2 == 0 ? i : segments - 1 - i;
      const SegmentGraph::Borders borders = graph.bordersOf(segment);
      DisparityPlane best;
      double least = std::numeric_limits<double>::infinity();
      const auto propose = [&](const DisparityPlane& plane) {
        if (!plane.is_known) return;
        double cost = supportCost(support[segment], plane, parameters.data_truncation);
        for (const SegmentGraph::Border& border : borders) {
          const DisparityPlane& neighbour = planes[border.neighbour];
          if (cost >= least) return;
          if (!neighbour.is_known) continue;
          cost += parameters.border_weight *
                  borderCost(graph, border, plane, neighbour, parameters.border_truncation);
        }
        if (cost >= least) return;
        least = cost;
        best = plane;
      };
      propose(planes[segment]);
      propose(fitted[segment]);
      for (const SegmentGraph::Border& border : borders) propose(planes[border.neighbour]);
      if (best.is_known) planes[segment] = best;
    }
  }
}

}  // namespace disparity_refinement
