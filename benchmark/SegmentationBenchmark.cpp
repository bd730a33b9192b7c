// The segmentation and its stages, beside operators of OpenCV that do less.

#include <opencv2/imgproc.hpp>

#include "benchmarks.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {
namespace {

void registerOpenCv(const std::string& set) {
  registerBenchmark(set, "cv::morphologyEx, gradient 3x3", 1, [](const Frame& frame) {
    return [&frame, gradient = cv::Mat()]() mutable {
      cv::morphologyEx(frame.left, gradient, cv::MORPH_GRADIENT, cv::Mat::ones(3, 3, CV_8UC1));
    };
  });
  registerBenchmark(set, "cv::connectedComponents", 1, [](const Frame& frame) {
    cv::Mat gradient;
    Gradient().compute(frame.left, {}, gradient);
    const cv::Mat flat = gradient < cv::mean(gradient)[0];
    return [flat, labels = cv::Mat()]() mutable { cv::connectedComponents(flat, labels, 8, CV_32S); };
  });
  registerBenchmark(set, "cv::watershed", 1, [](const Frame& frame) {
    cv::Mat color;
    cv::cvtColor(frame.left, color, cv::COLOR_GRAY2BGR);
    // About as many seeds as a KITTI frame has segments.
    constexpr int SPACING = 27;
    cv::Mat seeds(color.size(), CV_32SC1, cv::Scalar(0));
    int count = 0;
    for (int y = SPACING / 2; y < seeds.rows; y += SPACING) {
      for (int x = SPACING / 2; x < seeds.cols; x += SPACING) seeds.at<int>(y, x) = ++count;
    }
    return [color, seeds, markers = cv::Mat()]() mutable {
      seeds.copyTo(markers);
      cv::watershed(color, markers);
    };
  });
}

void registerFilteredWatershed(const std::string& set, const std::string& name, Connectivity connectivity,
                               int threads) {
  registerBenchmark(set, name, threads, [connectivity, threads](const Frame& frame) {
    FilteredWatershed watershed(threads);
    cv::Mat image = watershed.image(frame.left.size());
    Gradient().compute(frame.left, {}, image);
    return [connectivity, watershed = std::move(watershed), labels = cv::Mat()]() mutable {
      watershed.compute(30, 5, connectivity, labels);
    };
  });
}

void registerSegmentation(const std::string& set, const std::string& name, int lambda, int h, int threads) {
  registerBenchmark(set, name, threads, [lambda, h, threads](const Frame& frame) {
    SegmentationParameters parameters;
    parameters.lambda = lambda;
    parameters.h = h;
    return [&frame, parameters, segmentation = Segmentation(threads), labels = cv::Mat()]() mutable {
      segmentation.compute(frame.left, parameters, labels);
    };
  });
}

}  // namespace

void registerSegmentationBenchmarks(const std::string& set) {
  registerOpenCv(set);
  registerBenchmark(set, "gradient", 1, [](const Frame& frame) {
    return [&frame, gradient = Gradient(), image = cv::Mat()]() mutable {
      gradient.compute(frame.left, {}, image);
    };
  });
  registerFilteredWatershed(set, "filtered watershed, 4-connectivity", Connectivity::FOUR, 1);
  registerFilteredWatershed(set, "filtered watershed", Connectivity::EIGHT, 1);
  registerFilteredWatershed(set, "filtered watershed, 2 threads", Connectivity::EIGHT, 2);
  registerSegmentation(set, "segmentation (5,2)", 5, 2, 1);
  registerSegmentation(set, "segmentation (30,5)", 30, 5, 1);
  registerSegmentation(set, "segmentation (80,15)", 80, 15, 1);
  registerSegmentation(set, "segmentation (30,5), 2 threads", 30, 5, 2);
  registerBenchmark(set, "count surface, 161x61", 1, [](const Frame& frame) {
    return [&frame, segmentation = Segmentation()]() mutable {
      segmentation.countSurface(frame.left, {}, 160, 60);
    };
  });
}

}  // namespace disparity_refinement
