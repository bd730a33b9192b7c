// Times of the segmentation's stages on one thread, beside OpenCV functions as yardsticks: the ratios inside
// one run say more than the milliseconds, which depend on the machine.
//
// The image is image_0/000000_10.png of the folder that the environment variable DISPARITY_REFINEMENT_KITTI
// names (a KITTI `training` folder); without it, smoothed noise of the same size.

#include <benchmark/benchmark.h>

#include <cstdlib>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {
namespace {

cv::Mat smoothedNoise() {
  cv::Mat noise(375, 1242, CV_8UC1);
  cv::RNG random(1);
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(noise, noise, cv::Size(), 4.0);
  cv::normalize(noise, noise, 0, 255, cv::NORM_MINMAX);
  return noise;
}

const cv::Mat& grayImage() {
  static const cv::Mat image = [] {
    const char* folder = std::getenv("DISPARITY_REFINEMENT_KITTI");
    if (folder == nullptr) return smoothedNoise();
    const std::string file = std::string(folder) + "/image_0/000000_10.png";
    const cv::Mat gray = cv::imread(file, cv::IMREAD_GRAYSCALE);
    if (gray.empty()) throw std::runtime_error("cannot read " + file);
    return gray;
  }();
  return image;
}

/// The default parameters with the connectivity of the benchmark's argument.
SegmentationParameters parametersOf(const benchmark::State& state) {
  SegmentationParameters parameters;
  parameters.connectivity = static_cast<Connectivity>(state.range(0));
  return parameters;
}

void gradient(benchmark::State& state) {
  Gradient gradient;
  cv::Mat output;
  for (auto _ : state) gradient.compute(grayImage(), {}, output);
}

void treeBuild(benchmark::State& state) {
  const Connectivity connectivity = parametersOf(state).connectivity;
  cv::Mat gradient_image;
  Gradient().compute(grayImage(), {}, gradient_image);
  MinTree tree;
  for (auto _ : state) tree.build(gradient_image, connectivity);
  state.counters["nodes"] = static_cast<double>(tree.nodes().size());
}

void filter(benchmark::State& state) {
  const SegmentationParameters parameters = parametersOf(state);
  cv::Mat image;
  Gradient().compute(grayImage(), {}, image);
  MinTree tree;
  tree.build(image, parameters.connectivity);
  for (auto _ : state) tree.filter(parameters.lambda, parameters.h, image);
}

void watershed(benchmark::State& state) {
  const SegmentationParameters parameters = parametersOf(state);
  cv::Mat labels;
  Segmentation segmentation;
  segmentation.compute(grayImage(), parameters, labels);
  Watershed watershed;
  for (auto _ : state) watershed.compute(segmentation.filtered(), parameters.connectivity, labels);
}

void wholeSegmentation(benchmark::State& state) {
  SegmentationParameters parameters = parametersOf(state);
  parameters.lambda = static_cast<int>(state.range(1));
  parameters.h = static_cast<int>(state.range(2));
  Segmentation segmentation;
  cv::Mat labels;
  int count = 0;
  for (auto _ : state) count = segmentation.compute(grayImage(), parameters, labels);
  state.counters["segments"] = count;
}

void countSurface(benchmark::State& state) {
  cv::Mat gradient_image;
  Gradient().compute(grayImage(), {}, gradient_image);
  MinTree tree;
  tree.build(gradient_image, parametersOf(state).connectivity);
  for (auto _ : state) benchmark::DoNotOptimize(tree.countSurface(160, 60));
}

void openCvStereoSgbm(benchmark::State& state) {
  // The right image of a plane at a disparity of 32 px.
  const cv::Mat& left = grayImage();
  cv::Mat right;
  cv::copyMakeBorder(left.colRange(32, left.cols), right, 0, 0, 0, 32, cv::BORDER_REPLICATE);
  const auto matcher =
      cv::StereoSGBM::create(0, 128, 5, 8 * 25, 32 * 25, 1, 63, 10, 100, 2, cv::StereoSGBM::MODE_SGBM);
  cv::Mat disparity;
  for (auto _ : state) matcher->compute(left, right, disparity);
}

void openCvWatershed(benchmark::State& state) {
  cv::Mat color, markers;
  cv::cvtColor(grayImage(), color, cv::COLOR_GRAY2BGR);
  cv::Mat seeds(grayImage().size(), CV_32SC1, cv::Scalar(0));
  int count = 0;
  for (int y = 12; y < seeds.rows; y += 27) {
    for (int x = 12; x < seeds.cols; x += 27) seeds.at<int>(y, x) = ++count;
  }
  for (auto _ : state) {
    seeds.copyTo(markers);
    cv::watershed(color, markers);
  }
  state.counters["segments"] = count;
}

BENCHMARK(openCvStereoSgbm)->Unit(benchmark::kMillisecond);
BENCHMARK(openCvWatershed)->Unit(benchmark::kMillisecond);
BENCHMARK(gradient)->Unit(benchmark::kMillisecond);
BENCHMARK(treeBuild)->Unit(benchmark::kMillisecond)->ArgName("connectivity")->Arg(4)->Arg(8);
BENCHMARK(filter)->Unit(benchmark::kMillisecond)->ArgName("connectivity")->Arg(4)->Arg(8);
BENCHMARK(watershed)->Unit(benchmark::kMillisecond)->ArgName("connectivity")->Arg(4)->Arg(8);
BENCHMARK(wholeSegmentation)
    ->Unit(benchmark::kMillisecond)
    ->ArgNames({"connectivity", "lambda", "h"})
    ->Args({4, 5, 2})
    ->Args({4, 30, 5})
    ->Args({4, 80, 15})
    ->Args({8, 30, 5});
BENCHMARK(countSurface)->Unit(benchmark::kMillisecond)->ArgName("connectivity")->Arg(4)->Arg(8);

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
