#include "disparity_refinement/visualization/Panels.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

constexpr int TITLE_HEIGHT = 24;
constexpr int GAP = 4;

}  // namespace

cv::Mat arrangePanels(const std::vector<Panel>& panels, int columns) {
  if (panels.empty() || columns < 1) throw std::invalid_argument("no panels to arrange");
  const cv::Mat& first = panels.front().picture;
  const cv::Size size(first.cols, first.rows);
  for (const Panel& panel : panels) {
    const std::string name = "panel '" + panel.title + "'";
    requireImage(panel.picture, name.c_str(), panel.picture.channels() == 3 ? CV_8UC3 : CV_8UC1, size);
  }
  const int count = static_cast<int>(panels.size());
  columns = std::min(columns, count);
  const int rows = (count + columns - 1) / columns;
  const cv::Size cell(size.width + GAP, size.height + TITLE_HEIGHT);
  cv::Mat sheet(rows * cell.height, columns * cell.width - GAP, CV_8UC3, cv::Scalar::all(255));
  for (int i = 0; i < count; ++i) {
    const Panel& panel = panels[static_cast<std::size_t>(i)];
    const cv::Point origin(i % columns * cell.width, i / columns * cell.height);
    cv::putText(sheet, panel.title, origin + cv::Point(2, TITLE_HEIGHT - 8), cv::FONT_HERSHEY_SIMPLEX, 0.5,
                cv::Scalar::all(0), 1, cv::LINE_AA);
    cv::Mat target = sheet(cv::Rect(origin + cv::Point(0, TITLE_HEIGHT), size));
    if (panel.picture.channels() == 1) {
      cv::cvtColor(panel.picture, target, cv::COLOR_GRAY2BGR);
    } else {
      panel.picture.copyTo(target);
    }
  }
  return sheet;
}

}  // namespace disparity_refinement
