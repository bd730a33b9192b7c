// Times of the stages, beside OpenCV's as yardsticks: the ratios inside one run say more than the
// milliseconds, which depend on the machine. scripts/benchmark makes a table of them.

#include <iostream>

#include "benchmarks.hpp"

int main(int argc, char** argv) {
  using namespace disparity_refinement;
  if (argc == 2 && std::string(argv[1]) == "--versions") {
#ifdef HAVE_XIMGPROC
    constexpr bool HAS_XIMGPROC = true;
#else
    constexpr bool HAS_XIMGPROC = false;
#endif
    std::cout << R"({"opencv": ")" << CV_VERSION << R"(", "compiler": ")" << COMPILER << R"(", "ximgproc": )"
              << std::boolalpha << HAS_XIMGPROC << "}\n";
    return 0;
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  cv::setNumThreads(1);
  for (const std::string& set : frameSetNames()) {
    registerMatchingBenchmarks(set);
    registerSegmentationBenchmarks(set);
    registerRefinementBenchmarks(set);
  }
  benchmark::RunSpecifiedBenchmarks();
}
