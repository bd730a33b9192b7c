// Time of the plane refinement on one thread, beside cv::StereoSGBM as the yardstick: the ratio inside one
// run says more than the milliseconds, which depend on the machine.
//
// The pair is frame 000000_10 of the folder that the environment variable DISPARITY_REFINEMENT_KITTI names (a
// KITTI `training` folder); without it, the synthetic street at the same size.

#include <benchmark/benchmark.h>

#include <cstdlib>
#include <opencv2/calib3d.hpp>
#include <string>

#include "disparity_refinement/evaluation/KittiFiles.hpp"
#include "disparity_refinement/evaluation/SyntheticStreet.hpp"
#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/refinement/PlaneRefinement.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {
namespace {

StreetFrame readFrame() {
  const char* folder = std::getenv("DISPARITY_REFINEMENT_KITTI");
  if (folder != nullptr) {
    const std::string name = "/000000_10.png";
    return {readGrayImage(std::string(folder) + "/image_0" + name),
            readGrayImage(std::string(folder) + "/image_1" + name),
            {}};
  }
  StreetParameters street;
  street.width = 1242;
  street.height = 375;
  street.focal_length = 721.0;
  street.baseline = 0.54;
  return SyntheticStreet(street).render(0);
}

const StreetFrame& pair() {
  static const StreetFrame frame = readFrame();
  return frame;
}

void openCvStereoSgbm(benchmark::State& state) {
  const auto matcher =
      cv::StereoSGBM::create(0, 128, 5, 8 * 25, 32 * 25, 1, 63, 10, 100, 2, cv::StereoSGBM::MODE_SGBM);
  cv::Mat disparity;
  for (auto _ : state) matcher->compute(pair().left, pair().right, disparity);
}

void planeRefinement(benchmark::State& state) {
  StereoMatcher matcher;
  cv::Mat disparity, labels, refined;
  matcher.compute(pair().left, pair().right, disparity);
  SegmentationParameters segmentation;
  segmentation.lambda = static_cast<int>(state.range(0));
  segmentation.h = static_cast<int>(state.range(1));
  state.counters["segments"] = Segmentation().compute(pair().left, segmentation, labels);

  PlaneRefinement refinement;
  for (auto _ : state) refinement.refine(disparity, labels, matcher.range(), 389.0, {}, refined);
}

BENCHMARK(openCvStereoSgbm)->Unit(benchmark::kMillisecond);
BENCHMARK(planeRefinement)
    ->Unit(benchmark::kMillisecond)
    ->ArgNames({"lambda", "h"})
    ->Args({5, 2})
    ->Args({30, 5})
    ->Args({80, 15});

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
