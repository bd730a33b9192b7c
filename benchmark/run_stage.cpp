// Runs one stage on one frame and nothing else, for what counts instructions, and prints the memory it keeps.
//
// - run_stage prepare SET FOLDER writes the first frame of a set (see Frames.hpp) as left.png, right.png,
//   disparity.png.
// - run_stage matching FOLDER N matches it N times by CensusSgm and filters speckles, with vectors that
//   every processor has, so that the count hardly depends on it.
// - run_stage segmentation FOLDER N segments it N times.
// - run_stage refinement FOLDER N segments it once and refines its disparity N times.

#include <malloc.h>

#include <cstdlib>
#include <functional>
#include <iostream>
#include <opencv2/imgcodecs.hpp>

#include "Frames.hpp"
#include "disparity_refinement/evaluation/KittiFiles.hpp"
#include "disparity_refinement/matching/CensusSgm.hpp"
#include "disparity_refinement/matching/SpeckleFilter.hpp"
#include "disparity_refinement/refinement/PlaneRefinement.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {
namespace {

void prepare(const std::string& set, const std::string& folder) {
  const Frame& frame = frameSet(set).frames.front();
  cv::imwrite(folder + "/left.png", frame.left);
  cv::imwrite(folder + "/right.png", frame.right);
  writeDisparityPng(folder + "/disparity.png", frame.disparity, frame.range);
}

double allocatedBytes() {
#if defined(__GLIBC_PREREQ) && __GLIBC_PREREQ(2, 33)
  const auto info = mallinfo2();
#else
  const auto info = mallinfo();
#endif
  return static_cast<double>(info.uordblks) + static_cast<double>(info.hblkhd);
}

/// Prints what the stage holds after its runs [bytes a pixel]; input and output do not count.
void printScratch(const cv::Mat& input, const std::function<void()>& runs) {
  const double before = allocatedBytes();
  runs();
  std::cout << (allocatedBytes() - before) / static_cast<double>(input.total()) << "\n";
}

void match(const std::string& folder, int n) {
  const cv::Mat left = readGrayImage(folder + "/left.png"), right = readGrayImage(folder + "/right.png");
  CensusSgmParameters parameters;
  parameters.disparity_range = DISPARITIES;
  cv::Mat disparity(left.size(), CV_16SC1);
  CensusSgm matcher(CensusSgm::Vectors::BYTES_16);
  SpeckleFilter speckle_filter;
  printScratch(left, [&] {
    for (int i = 0; i < n; ++i) {
      matcher.compute(left, right, parameters, disparity);
      speckle_filter.apply(disparity, CensusSgm::INVALID, 100, 2 * CensusSgm::SUBPIXEL_STEPS);
    }
  });
}

void segment(const std::string& folder, int n) {
  const cv::Mat left = readGrayImage(folder + "/left.png");
  cv::Mat labels(left.size(), CV_32SC1);
  Segmentation segmentation;
  printScratch(left, [&] {
    for (int i = 0; i < n; ++i) segmentation.compute(left, {}, labels);
  });
}

void refine(const std::string& folder, int n) {
  const cv::Mat left = readGrayImage(folder + "/left.png");
  const cv::Mat disparity = readDisparityPng(folder + "/disparity.png");
  cv::Mat labels, refined(left.size(), CV_32FC1);
  Segmentation().compute(left, {}, labels);
  PlaneRefinement refinement;
  printScratch(left, [&] {
    for (int i = 0; i < n; ++i)
      refinement.refine(disparity, labels, KITTI_PNG_RANGE, 721.0 * 0.54, {}, refined);
  });
}

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  using namespace disparity_refinement;
  const std::string command = argc == 4 ? argv[1] : "";
  cv::setNumThreads(1);
  if (command == "prepare") {
    prepare(argv[2], argv[3]);
  } else if (command == "matching") {
    match(argv[2], std::atoi(argv[3]));
  } else if (command == "segmentation") {
    segment(argv[2], std::atoi(argv[3]));
  } else if (command == "refinement") {
    refine(argv[2], std::atoi(argv[3]));
  } else {
    std::cerr << "run_stage: expected prepare SET FOLDER, or matching, segmentation or refinement FOLDER N\n";
    return 1;
  }
}
