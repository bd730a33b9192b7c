#include <algorithm>
#include <opencv2/core/utility.hpp>
#include <thread>
#include <vector>

// OpenCV's parallel loop by threads that ThreadSanitizer sees. OpenCV's own come from a library without
// instrumentation, so that every hand-over of data between them would look like a race. The linker takes this
// one.
namespace cv {

void parallel_for_(const Range& range, const ParallelLoopBody& body, double /*stripes*/) {
  const int n = range.size(), parts = std::max(1, std::min(getNumThreads(), n));
  std::vector<std::thread> threads;
  for (int i = 0; i < parts; ++i) {
    threads.emplace_back(
        [&, i] { body(Range(range.start + n * i / parts, range.start + n * (i + 1) / parts)); });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace cv
