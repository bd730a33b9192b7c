#include "disparity_refinement/segmentation/Gradient.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core/hal/intrin.hpp>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/segmentation/branchless.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {
namespace {

using cv::v_uint8x16;

constexpr int LANES = 16;
// Before and after a line: room for the neighbours of its ends, and for whole vectors.
constexpr int MARGIN = LANES;

// c * g^gamma with c = 255^(1 - gamma), which keeps 0 and 255.
void fillShadowTable(double gamma, std::array<std::uint8_t, 256>& table) {
  for (int g = 0; g < 256; ++g) {
    table[g] = static_cast<std::uint8_t>(std::lround(std::pow(255.0, 1.0 - gamma) * std::pow(g, gamma)));
  }
}

// Repeats the ends of a line in its margins: they change neither a minimum nor a maximum.
void fillMargins(std::uint8_t* line, int size) {
  line[-1] = line[0];
  line[size] = line[size - 1];
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

void Gradient::compute(const cv::Mat& gray, const GradientParameters& parameters, cv::Mat& gradient,
                       int strips) {
  validate(parameters);
  requireImage(gray, "gray", CV_8UC1);
  requireArgument(strips >= 1, "strips", strips, "at least 1");
  if (shadow_table_gamma_ != parameters.shadow_gamma) {
    fillShadowTable(parameters.shadow_gamma, shadow_table_);
    shadow_table_gamma_ = parameters.shadow_gamma;
  }
  lines_.resize(strips);
  // Rows that are still needed must not be overwritten.
  const cv::Mat source = overlap(gray, gradient) ? gray.clone() : gray;
  gradient.create(source.size(), CV_8UC1);
  forEachStrip(strips, [&](int i) {
    for (Line* line : {&lines_[i].own, &lines_[i].highest, &lines_[i].lowest}) {
      line->resize(source.cols + 2 * MARGIN);
    }
    computeRows(source, parameters, stripOf(source.rows, i, strips), lines_[i], gradient);
  });
}

void Gradient::computeRows(const cv::Mat& gray, const GradientParameters& parameters, cv::Range rows,
                           Lines& lines, cv::Mat& gradient) const {
  const int cols = gray.cols;
  std::uint8_t* own = lines.own.data() + MARGIN;
  // Of the three pixels above each other.
  std::uint8_t* highest = lines.highest.data() + MARGIN;
  std::uint8_t* lowest = lines.lowest.data() + MARGIN;
  const bool cross = parameters.structuring_element == StructuringElement::CROSS;
  // What the element covers on the left and on the right.
  const std::uint8_t* side_highest = cross ? own : highest;
  const std::uint8_t* side_lowest = cross ? own : lowest;
  const v_uint8x16 threshold = cv::v_setall_u8(static_cast<std::uint8_t>(parameters.shadow_threshold));

  for (int y = rows.start; y < rows.end; ++y) {
    const std::uint8_t* above = gray.ptr<std::uint8_t>(std::max(y - 1, 0));
    const std::uint8_t* below = gray.ptr<std::uint8_t>(std::min(y + 1, gray.rows - 1));
    std::copy_n(gray.ptr<std::uint8_t>(y), cols, own);
    int x = 0;
    for (; x + LANES <= cols; x += LANES) {
      const v_uint8x16 a = cv::v_load(above + x), b = cv::v_load(own + x), c = cv::v_load(below + x);
      cv::v_store(highest + x, cv::v_max(cv::v_max(a, b), c));
      cv::v_store(lowest + x, cv::v_min(cv::v_min(a, b), c));
    }
    for (; x < cols; ++x) {
      highest[x] = std::max({above[x], own[x], below[x]});
      lowest[x] = std::min({above[x], own[x], below[x]});
    }
    fillMargins(own, cols);
    fillMargins(highest, cols);
    fillMargins(lowest, cols);

    auto* out = gradient.ptr<std::uint8_t>(y);
    for (x = 0; x < cols; x += LANES) {
      const v_uint8x16 high = cv::v_max(cv::v_load(highest + x), cv::v_max(cv::v_load(side_highest + x - 1),
                                                                           cv::v_load(side_highest + x + 1)));
      const v_uint8x16 low = cv::v_min(cv::v_load(lowest + x), cv::v_min(cv::v_load(side_lowest + x - 1),
                                                                         cv::v_load(side_lowest + x + 1)));
      const v_uint8x16 difference = high - low;
      const v_uint8x16 value = cv::v_load(own + x);
      const v_uint8x16 in_shadow = cv::v_min(value, threshold) == value;
      const bool stretch = parameters.shadow_enhancement && cv::v_signmask(in_shadow) != 0;
      if (!stretch && x + LANES <= cols) {
        cv::v_store(out + x, difference);
        continue;
      }
      std::array<std::uint8_t, LANES> lit, shadow;
      cv::v_store(lit.data(), difference);
      cv::v_store(shadow.data(), stretch ? in_shadow : cv::v_setzero_u8());
      for (int k = 0; k < std::min(LANES, cols - x); ++k) {
        out[x + k] = static_cast<std::uint8_t>(select(shadow[k] != 0, shadow_table_[lit[k]], lit[k]));
      }
    }
  }
}

}  // namespace disparity_refinement
