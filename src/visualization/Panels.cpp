#include "disparity_refinement/visualization/Panels.hpp"

#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace disparity_refinement {
namespace {

constexpr int TITLE_HEIGHT = 24;
constexpr int GAP = 4;

}  // namespace

cv::Mat arrangePanels(const std::vector<Panel>& panels, int columns) {
  if (panels.empty() || columns < 1) throw std::invalid_argument("no panels to arrange");
  const cv::Size size = panels.front().picture.size();
  const int count = static_cast<int>(panels.size());
  const int rows = (count + columns - 1) / columns;
  const cv::Size cell(size.width + GAP, size.height + TITLE_HEIGHT);
  cv::Mat sheet(rows * cell.height, columns * cell.width - GAP, CV_8UC3, cv::Scalar::all(255));
  for (int i = 0; i < count; ++i) {
    const Panel& panel = panels[static_cast<std::size_t>(i)];
    if (panel.picture.size() != size ||
        (panel.picture.type() != CV_8UC1 && panel.picture.type() != CV_8UC3)) {
      throw std::invalid_argument("panel '" + panel.title +
                                  "': expected 8 bits and the size of the first panel");
    }
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
