#include "disparity_refinement/refinement/SegmentGraph.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>

#include "disparity_refinement/buffers.hpp"

namespace disparity_refinement {

void SegmentGraph::findContacts(const cv::Mat& labels, const cv::Mat& gray, double half_contrast) {
  std::array<float, 256> weights;
  for (int i = 0; i < 256; ++i) weights[i] = static_cast<float>(half_contrast / (half_contrast + i));

  contacts_.clear();
  for (int y = 0; y < labels.rows; ++y) {
    const int below = std::min(y + 1, labels.rows - 1);
    const int *label = labels.ptr<int>(y), *label_below = labels.ptr<int>(below);
    const auto *value = gray.ptr<std::uint8_t>(y), *value_below = gray.ptr<std::uint8_t>(below);
    const auto add = [&](int a, int b, float point_x, float point_y, int contrast) {
      if (a < 0 || b < 0) return;
      contacts_.push_back({std::min(a, b), std::max(a, b), {point_x, point_y, weights[std::abs(contrast)]}});
    };
    const float row = static_cast<float>(y);
    for (int x = 0; x < labels.cols; ++x) {
      const float column = static_cast<float>(x);
      if (x + 1 < labels.cols && label[x] != label[x + 1]) {
        add(label[x], label[x + 1], column + 0.5F, row, value[x] - value[x + 1]);
      }
      if (label[x] != label_below[x]) {
        add(label[x], label_below[x], column, row + 0.5F, value[x] - value_below[x]);
      }
    }
  }
}

// By the lower and then by the higher label; contacts of the same two stay in raster order.
void SegmentGraph::sortContacts(int segments) {
  const auto sortBy = [&](int Contact::*label) {
    growTo(counts_, segments + 1);
    counts_.assign(segments + 1, 0);
    for (const Contact& contact : contacts_) ++counts_[contact.*label + 1];
    for (int i = 0; i < segments; ++i) counts_[i + 1] += counts_[i];
    growTo(sorted_, contacts_.size());
    sorted_.resize(contacts_.size());
    for (const Contact& contact : contacts_) sorted_[counts_[contact.*label]++] = contact;
    contacts_.swap(sorted_);
  };
  sortBy(&Contact::high);
  sortBy(&Contact::low);
}

void SegmentGraph::build(const cv::Mat& labels, const cv::Mat& gray, int segments, double half_contrast) {
  findContacts(labels, gray, half_contrast);
  sortContacts(segments);

  const int size = static_cast<int>(contacts_.size());
  growTo(points_, size);
  for (int i = 0; i < size; ++i) points_[i] = contacts_[i].point;
  const auto forEachBorder = [&](const auto& visit) {
    int end = 0;
    for (int first = 0; first < size; first = end) {
      const Contact& contact = contacts_[first];
      while (end < size && contacts_[end].low == contact.low && contacts_[end].high == contact.high) ++end;
      visit(contact.low, contact.high, first, end);
    }
  };
  // Counted two places further on, so that placing the borders moves the counts to where they belong.
  growTo(first_border_, segments + 2);
  first_border_.assign(segments + 2, 0);
  forEachBorder([&](int low, int high, int, int) {
    ++first_border_[low + 2];
    ++first_border_[high + 2];
  });
  for (int i = 2; i < segments + 2; ++i) first_border_[i] += first_border_[i - 1];
  growTo(borders_, first_border_[segments + 1]);
  // Those to lower labels first: a border is met in the order of its lower label.
  forEachBorder([&](int low, int high, int first, int end) {
    borders_[first_border_[low + 1]++] = {high, first, end};
    borders_[first_border_[high + 1]++] = {low, first, end};
  });
}

}  // namespace disparity_refinement
