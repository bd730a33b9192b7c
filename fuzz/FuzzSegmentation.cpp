// Segmentation: images of any size and content, any parameters, any number of strips. What comes out is that
// of the operators of the paper, one after the other.

#include <set>

#include "Input.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"
#include "straightforward/MinTree.hpp"
#include "straightforward/Watershed.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

SegmentationParameters parametersOf(Input& input) {
  SegmentationParameters parameters;
  parameters.lambda = input.yes() ? input.parameter(0, 100) : input.parameter(0, 1000000);
  parameters.h = input.parameter(0, 255);
  parameters.connectivity = input.yes() ? Connectivity::FOUR : Connectivity::EIGHT;
  if (input.isWild() && input.oneIn(8)) parameters.connectivity = input.enumeration<Connectivity>(0, 9);
  parameters.gradient.structuring_element = input.enumeration<StructuringElement>(0, 1);
  parameters.gradient.shadow_enhancement = input.yes();
  parameters.gradient.shadow_threshold = input.parameter(0, 255);
  parameters.gradient.shadow_gamma = input.parameter(0.01, 1.0);
  return parameters;
}

// The range of gray values under the structuring element, without the shadow's enhancement.
int gradientAt(const cv::Mat& gray, StructuringElement element, int x, int y) {
  int least = 255, most = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const bool is_inside = x + dx >= 0 && x + dx < gray.cols && y + dy >= 0 && y + dy < gray.rows;
      if (!is_inside || (element == StructuringElement::CROSS && dx != 0 && dy != 0)) continue;
      const int value = gray.at<std::uint8_t>(y + dy, x + dx);
      least = std::min(least, value);
      most = std::max(most, value);
    }
  }
  return most - least;
}

void requireGradient(const cv::Mat& gray, const cv::Mat& gradient, const GradientParameters& parameters) {
  for (int y = 0; y < gray.rows; ++y) {
    for (int x = 0; x < gray.cols; ++x) {
      const bool is_lit =
          !parameters.shadow_enhancement || gray.at<std::uint8_t>(y, x) > parameters.shadow_threshold;
      const int plain = gradientAt(gray, parameters.structuring_element, x, y),
                value = gradient.at<std::uint8_t>(y, x);
      require(is_lit ? value == plain : value >= plain, "the gradient is that of its definition");
    }
  }
}

void requireSegments(const Segmentation& segmentation, const SegmentationParameters& parameters, int n,
                     const cv::Mat& labels) {
  straightforward::MinTree tree;
  straightforward::Watershed watershed;
  cv::Mat filtered, expected;
  tree.build(segmentation.gradient(), parameters.connectivity);
  tree.filter(parameters.lambda, parameters.h, filtered);
  require(same(segmentation.filtered(), filtered), "the filters are those of their definition");
  require(watershed.compute(filtered, parameters.connectivity, expected) == n, "n is the number of minima");
  require(same(labels, expected), "the labels are those of the definition");
  const std::set<int> found(expected.begin<int>(), expected.end<int>());
  require(static_cast<int>(found.size()) == n && *found.begin() == 0 && *found.rbegin() == n - 1,
          "the labels are 0 ... n - 1");
}

}  // namespace

void test(Input& input) {
  const int strips = input.oneIn(2) ? 1 : input.parameter(1, 64);
  std::unique_ptr<Segmentation> segmentation;
  if (!succeeds([&] { segmentation = std::make_unique<Segmentation>(strips); })) return;
  const Threads threads(strips > 1 && input.oneIn(4) ? 2 : 1);
  // Another image before, for the buffers are kept.
  for (int i = input.number(0, 1); i >= 0; --i) {
    const SegmentationParameters parameters = parametersOf(input);
    const cv::Size size = input.size(60, 40);
    const Picture gray = input.gray(size);
    Picture labels = input.picture(size, CV_32SC1);
    int n = 0;
    if (!succeeds([&] { n = segmentation->compute(gray.mat(), parameters, labels.mat()); })) continue;
    require(gray.mat().type() == CV_8UC1 && !gray.mat().empty(), "other images are refused");
    requireGradient(gray.mat(), segmentation->gradient(), parameters.gradient);
    requireSegments(*segmentation, parameters, n, labels.mat());
    if (!input.oneIn(3)) continue;
    const int max_lambda = input.parameter(0, 40), max_h = input.parameter(0, 40);
    cv::Mat counts;
    if (!succeeds([&] { counts = segmentation->countSurface(gray.mat(), parameters, max_lambda, max_h); }))
      continue;
    require(counts.size() == cv::Size(max_h + 1, max_lambda + 1), "there is a count for every lambda and h");
    if (parameters.lambda <= max_lambda && parameters.h <= max_h) {
      require(counts.at<int>(parameters.lambda, parameters.h) == n, "the surface has the number of segments");
    }
  }
}

}  // namespace fuzz
}  // namespace disparity_refinement
