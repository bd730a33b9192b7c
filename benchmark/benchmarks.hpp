#pragma once

#include <benchmark/benchmark.h>

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "Frames.hpp"

/// The benchmarks of a frame set, in the order of the table that scripts/benchmark prints. One program runs
/// them all, so that every ratio is one of neighbours in time.
namespace disparity_refinement {

void registerMatchingBenchmarks(const std::string& set);
void registerSegmentationBenchmarks(const std::string& set);
void registerRefinementBenchmarks(const std::string& set);

/// Whether the first run, which allocates, is made before the clock starts.
enum class WarmUp { YES, NO };

/// Registers "<set>/<name>". `make(frame)` is called for every frame of the set and returns what is timed, a
/// callable. All frames of the set are one iteration.
template <class Make>
void registerBenchmark(const std::string& set, const std::string& name, int threads, const Make& make,
                       WarmUp warm_up = WarmUp::YES) {
  const auto measure = [=](benchmark::State& state) {
    const FrameSet& frames = frameSet(set);
    cv::setNumThreads(threads);
    std::vector<decltype(make(frames.frames.front()))> runs;
    runs.reserve(frames.frames.size());  // Growing, it would copy some.
    for (const Frame& frame : frames.frames) runs.push_back(make(frame));
    if (warm_up == WarmUp::YES) {
      for (auto& run : runs) run();
    }
    for (auto _ : state) {
      for (auto& run : runs) run();
    }
    cv::setNumThreads(1);
    state.counters["megapixels"] = frames.megapixels();
    state.counters["threads_used"] = threads;
  };
  benchmark::RegisterBenchmark((set + "/" + name).c_str(), measure)
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
}

}  // namespace disparity_refinement
