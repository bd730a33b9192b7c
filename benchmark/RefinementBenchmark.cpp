#include "benchmarks.hpp"
#include "disparity_refinement/refinement/PlaneRefinement.hpp"
#include "disparity_refinement/refinement/QualityRefinement.hpp"

namespace disparity_refinement {
namespace {

void registerRefinement(const std::string& set, const std::string& name, int threads) {
  registerBenchmark(set, name, threads, [](const Frame& frame) {
    return [&frame, refinement = PlaneRefinement(), refined = cv::Mat()]() mutable {
      refinement.refine(frame.disparity, frame.labels, frame.range, frame.focal_length_times_baseline, {},
                        refined);
    };
  });
}

void registerQuality(const std::string& set, const std::string& name, int threads) {
  registerBenchmark(set, name, threads, [](const Frame& frame) {
    return [&frame, refinement = QualityRefinement(), refined = cv::Mat()]() mutable {
      refinement.refine(frame.disparity, frame.labels, frame.left, frame.range, {}, {}, refined);
    };
  });
}

}  // namespace

void registerRefinementBenchmarks(const std::string& set) {
  registerRefinement(set, "plane refinement (30,5)", 1);
  registerRefinement(set, "plane refinement (30,5), 2 threads", 2);
  registerQuality(set, "quality refinement (30,5)", 1);
  registerQuality(set, "quality refinement (30,5), 2 threads", 2);
}

}  // namespace disparity_refinement
