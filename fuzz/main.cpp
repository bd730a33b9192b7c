#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <opencv2/core.hpp>

#include "Input.hpp"

/// Before the first input, in every harness.
extern "C" int LLVMFuzzerInitialize(int* /*argc*/, char*** /*argv*/) {
  cv::setNumThreads(1);
  // A file of a few bytes may claim any size: OpenCV's own bound, which is 2^30 pixels.
  setenv("OPENCV_IO_MAX_IMAGE_PIXELS", "1000000", 1);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  disparity_refinement::fuzz::Input input(bytes, size);
  disparity_refinement::fuzz::test(input);
  return 0;
}
