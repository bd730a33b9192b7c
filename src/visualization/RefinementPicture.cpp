#include "disparity_refinement/visualization/RefinementPicture.hpp"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "disparity_refinement/evaluation/KittiMetric.hpp"
#include "disparity_refinement/visualization/Colorize.hpp"
#include "disparity_refinement/visualization/Panels.hpp"

namespace disparity_refinement {
namespace {

/// "12.3 %"
std::string percent(double share) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f %%", 100.0 * share);
  return text;
}

double validShare(const cv::Mat& disparity, const DisparityRange& range) {
  const auto valid = std::count_if(disparity.begin<float>(), disparity.end<float>(),
                                   [&range](float d) { return range.isValid(d); });
  return static_cast<double>(valid) / static_cast<double>(disparity.total());
}

}  // namespace

cv::Mat drawRefinement(const RefinementPicture& frame) {
  std::vector<Panel> panels(2);
  panels[0] = {"left image", frame.image};
  panels[1].title = "segments";
  drawSegmentBorders(frame.image, frame.labels, panels[1].picture);

  // One scale for both maps.
  const float scale_min = frame.refined_range.min;
  const float scale_max = std::max(scale_min + 1.0F, std::min(frame.scale_max, frame.refined_range.max));
  const auto add_map = [&](const cv::Mat& map, const DisparityRange& range, const std::string& title) {
    Panel panel;
    colorizeDisparity(map, range, scale_min, scale_max, panel.picture);
    panel.title = title + ", " + percent(validShare(map, range)) + " valid";
    panels.push_back(panel);
  };
  add_map(frame.disparity, frame.disparity_range, frame.disparity_title);
  add_map(frame.refined, frame.refined_range, frame.refined_title);

  const auto add_error = [&](const cv::Mat& map, const DisparityRange& range, const std::string& title) {
    Panel panel;
    colorizeError(map, range, frame.ground_truth, panel.picture);
    panel.title = "error of " + title + ", " +
                  percent(scoreDisparity(map, range, frame.ground_truth).all.outliers[2]) + " > 3 px";
    panels.push_back(panel);
  };
  if (!frame.ground_truth.empty()) {
    add_error(frame.disparity, frame.disparity_range, frame.disparity_title);
    add_error(frame.refined, frame.refined_range, frame.refined_title);
  }
  return arrangePanels(panels, 2);
}

}  // namespace disparity_refinement
