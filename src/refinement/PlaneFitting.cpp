#include "disparity_refinement/refinement/PlaneFitting.hpp"

#include <algorithm>
#include <cstdint>

#include "disparity_refinement/buffers.hpp"
#include "disparity_refinement/refinement/PlaneFit.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {

void PlaneFitting::fitAll(const cv::Mat& disparity, const DisparityRange& range,
                          const PlaneRefinementParameters& parameters, const Visit& visit) {
  growTo(planes_, segments_.size());  // Room for more, but no more planes than segments.
  planes_.resize(segments_.size());
  const int threads = std::max(1, cv::getNumThreads());
  // More strips than threads, for the segments differ in size.
  const int strips = threads > 1 ? 8 * threads : 1;
  if (points_.size() < static_cast<std::size_t>(strips)) points_.resize(strips);
  forEachStrip(strips, [&](int i) {
    const cv::Range part = stripOf(segments_.size(), i, strips);
    for (int label = part.start; label < part.end; ++label) {
      planes_[label] = fitPlane(disparity, range, segments_[label], static_cast<std::uint64_t>(label),
                                parameters, points_[i]);
      visit(label, planes_[label], points_[i]);
    }
  });
}

}  // namespace disparity_refinement
