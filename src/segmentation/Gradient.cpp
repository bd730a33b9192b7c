#include "disparity_refinement/segmentation/Gradient.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

using Table = std::array<std::uint8_t, 256>;

Table identityTable() {
  Table table;
  std::iota(table.begin(), table.end(), std::uint8_t{0});
  return table;
}

/// c * g^gamma with c = 255^(1 - gamma), which keeps 0 and 255.
Table shadowTable(double gamma) {
  Table table;
  for (int g = 0; g < 256; ++g) {
    table[g] = static_cast<std::uint8_t>(std::lround(std::pow(255.0, 1.0 - gamma) * std::pow(g, gamma)));
  }
  return table;
}

}  // namespace

void validate(const GradientParameters& parameters) {
  const auto element = parameters.structuring_element;
  requireArgument(element == StructuringElement::CROSS || element == StructuringElement::SQUARE,
                  "structuring_element", static_cast<int>(element), "0 (cross) or 1 (square)");
  const int threshold = parameters.shadow_threshold;
  requireArgument(threshold >= 0 && threshold <= 255, "shadow_threshold", threshold, "0...255");
  const double gamma = parameters.shadow_gamma;
  requireArgument(gamma > 0.0 && gamma <= 1.0, "shadow_gamma", gamma, "greater than 0 and at most 1");
}

void Gradient::compute(const cv::Mat& gray, const GradientParameters& parameters, cv::Mat& gradient) {
  validate(parameters);
  requireImage(gray, "gray", CV_8UC1);

  const bool cross = parameters.structuring_element == StructuringElement::CROSS;
  const cv::Mat element = cv::getStructuringElement(cross ? cv::MORPH_CROSS : cv::MORPH_RECT, cv::Size(3, 3));
  // Isolated: if gray is a part of a larger image, OpenCV would look at the pixels around that part.
  const int border = cv::BORDER_CONSTANT | cv::BORDER_ISOLATED;
  cv::dilate(gray, dilated_, element, cv::Point(-1, -1), 1, border);
  cv::erode(gray, eroded_, element, cv::Point(-1, -1), 1, border);

  const Table lit = identityTable();
  const Table shadow = shadowTable(parameters.shadow_enhancement ? parameters.shadow_gamma : 1.0);
  gradient.create(gray.size(), CV_8UC1);
  for (int y = 0; y < gray.rows; ++y) {
    const std::uint8_t* value = gray.ptr<std::uint8_t>(y);
    const std::uint8_t* highest = dilated_.ptr<std::uint8_t>(y);
    const std::uint8_t* lowest = eroded_.ptr<std::uint8_t>(y);
    std::uint8_t* out = gradient.ptr<std::uint8_t>(y);
    for (int x = 0; x < gray.cols; ++x) {
      const Table& table = value[x] <= parameters.shadow_threshold ? shadow : lit;
      out[x] = table[highest[x] - lowest[x]];
    }
  }
}

}  // namespace disparity_refinement
