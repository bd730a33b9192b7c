#include "disparity_refinement/refinement/Confidence.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

DisparitySource sourceOf(float disparity, float refined, int x, int y, const SegmentPlane* fitted,
                         const DisparityRange& range) {
  if (!range.isValid(refined)) return DisparitySource::NONE;
  if (range.isValid(disparity) && std::abs(disparity - refined) <= SAME_SOURCE) {
    return DisparitySource::MEASURED;
  }
  if (fitted == nullptr || fitted->status != PlaneStatus::ACCEPTED) return DisparitySource::FILLED;
  const double on_plane = fitted->a * x + fitted->b * y + fitted->c;
  return std::abs(on_plane - refined) <= SAME_SOURCE ? DisparitySource::OWN_PLANE
                                                     : DisparitySource::NEIGHBOUR_PLANE;
}

}  // namespace

const char* toString(DisparitySource source) {
  switch (source) {
    case DisparitySource::NONE:
      return "none";
    case DisparitySource::MEASURED:
      return "measured";
    case DisparitySource::OWN_PLANE:
      return "own plane";
    case DisparitySource::NEIGHBOUR_PLANE:
      return "neighbour's plane";
    case DisparitySource::FILLED:
      return "filled";
  }
  return "unknown";
}

void findSources(const cv::Mat& disparity, const cv::Mat& refined, const cv::Mat& labels,
                 const DisparityRange& range, const std::vector<SegmentPlane>& fitted, cv::Mat& sources) {
  requireImage(disparity, "disparity", CV_32FC1);
  requireImage(refined, "refined", CV_32FC1, disparity.size());
  requireLabels(labels, disparity.size(), fitted.size());
  sources.create(disparity.size(), CV_8UC1);
  for (int y = 0; y < disparity.rows; ++y) {
    const auto *d = disparity.ptr<float>(y), *r = refined.ptr<float>(y);
    const int* label = labels.ptr<int>(y);
    auto* source = sources.ptr<std::uint8_t>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      const SegmentPlane* plane = label[x] < 0 ? nullptr : &fitted[label[x]];
      source[x] = static_cast<std::uint8_t>(sourceOf(d[x], r[x], x, y, plane, range));
    }
  }
}

void findConfidence(const cv::Mat& sources, cv::Mat& confidence) {
  requireImage(sources, "sources", CV_8UC1);
  confidence.create(sources.size(), CV_8UC1);
  const auto forEachPixel = [&](const auto& visit) {
    for (int y = 0; y < sources.rows; ++y) {
      const auto* source = sources.ptr<std::uint8_t>(y);
      auto* value = confidence.ptr<std::uint8_t>(y);
      for (int x = 0; x < sources.cols; ++x) visit(static_cast<DisparitySource>(source[x]), value[x]);
    }
  };
  forEachPixel([](DisparitySource source, std::uint8_t& value) {
    value = source == DisparitySource::MEASURED ? 255 : 0;
  });
  cv::blur(confidence, confidence, {CONFIDENCE_WINDOW, CONFIDENCE_WINDOW}, {-1, -1}, cv::BORDER_REPLICATE);
  forEachPixel([](DisparitySource source, std::uint8_t& value) {
    if (source == DisparitySource::NONE) value = 0;
  });
}

}  // namespace disparity_refinement
