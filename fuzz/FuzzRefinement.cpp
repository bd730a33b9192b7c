// DisparityRefinement in both modes, and what is said of its results: any disparities, labels, ranges and
// parameters.

#include <vector>

#include "Input.hpp"
#include "disparity_refinement/refinement/Confidence.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/refinement/RefinementStatistics.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

// As many as are asked for take as much time.
int few(int number) { return std::min(number, 5); }

PlaneRefinementParameters planeParametersOf(Input& input) {
  PlaneRefinementParameters parameters;
  parameters.inlier_threshold = input.parameter(0.01, 16.0);
  parameters.confidence = input.parameter(0.5, 0.9999);
  parameters.max_slope_x = input.parameter(0.01, 16.0);
  parameters.max_slope_y = input.parameter(0.01, 16.0);
  parameters.disparity_error = input.parameter(0.0, 16.0);
  parameters.max_depth_error = input.parameter(0.01, 1000.0);
  parameters.min_valid_fraction = input.parameter(0.0, 1.0);
  parameters.min_valid_points = input.oneIn(4) ? input.parameter(3, 100000) : input.parameter(3, 12);
  parameters.max_iterations = std::min(input.parameter(1, 200), 1000);
  parameters.max_divergence = input.parameter(0.0, 100.0);
  parameters.divergence_action = input.enumeration<DivergenceAction>(0, 2);
  parameters.out_of_range_action = input.enumeration<OutOfRangeAction>(0, 1);
  return parameters;
}

void changeLabeling(Input& input, PixelLabelingParameters& parameters) {
  parameters.data_weight = input.parameter(0.0, 10.0);
  parameters.data_truncation = input.parameter(0.01, 1.5);
  parameters.edge_share = input.parameter(0.0, 1.0);
  parameters.edge_reach = input.parameter(0, 16);
  parameters.edge_step = input.parameter(0.0, 100.0);
  parameters.neighbour_cost = input.parameter(0.0, 100.0);
  parameters.neighbour_cost_in_hole = input.parameter(0.0, 100.0);
  parameters.further_cost = input.parameter(0.0, 100.0);
  parameters.further_cost_in_hole = input.parameter(0.0, 100.0);
  parameters.measured_cost = input.parameter(0.0, 100.0);
  parameters.visibility_cost = input.parameter(0.0, 100.0);
  parameters.smoothness = input.parameter(0.0, 15.0);
  parameters.half_contrast = input.parameter(0.1, 1000.0);
  parameters.step_truncation = input.parameter(0.01, 1.0);
  parameters.soft_reach = input.parameter(0.0, 1000.0);
  parameters.half_cost = input.parameter(0.01, 100.0);
}

void changeQuality(Input& input, QualityParameters& parameters) {
  parameters.half_contrast = input.parameter(0.1, 1000.0);
  parameters.selection.sweeps = few(input.parameter(0, 4));
  parameters.selection.data_truncation = input.parameter(0.1, 100.0);
  parameters.selection.border_weight = input.parameter(0.0, 1e6);
  parameters.selection.border_truncation = input.parameter(0.1, 100.0);
  parameters.smoothing.sweeps = few(input.parameter(0, 3));
  parameters.smoothing.inlier_threshold = input.parameter(0.1, 100.0);
  parameters.smoothing.border_weight = input.parameter(0.0, 1e6);
  parameters.smoothing.max_step = input.parameter(0.1, 100.0);
  parameters.label_pixels = input.oneIn(4) ? input.yes() : true;
  if (input.yes()) changeLabeling(input, parameters.labeling);
  parameters.medians = few(input.parameter(0, 3));
}

RefinementParameters parametersOf(Input& input) {
  RefinementParameters parameters;
  parameters.mode = input.enumeration<RefinementMode>(0, 1);
  if (input.oneIn(4) == false) parameters.planes = planeParametersOf(input);
  if (parameters.mode == RefinementMode::PAPER) return parameters;
  const int further = input.oneIn(2) ? 0 : input.parameter(0, MAX_FURTHER_SEGMENTATIONS);
  succeeds([&] { parameters.quality.further = furtherSegmentations(further); }, "further_segmentations");
  if (input.yes()) changeQuality(input, parameters.quality);
  return parameters;
}

struct Frame {
  explicit Frame(Input& input)
      : parameters(parametersOf(input)),
        range(input.range()),
        size(input.size(40, 24)),
        f_times_t(input.oneIn(2) ? 200.0 : input.parameter(1e-3, 1e5)),
        disparity(input.disparity(size, range)),
        labels(input.labels(size)),
        gray(input.gray(size)) {}

  void refine(DisparityRefinement& refinement, cv::Mat& refined) const {
    refinement.refine(disparity.mat(), labels.mat(), gray.mat(), range, f_times_t, parameters, refined);
  }

  RefinementParameters parameters;
  DisparityRange range;
  cv::Size size;
  double f_times_t;
  Picture disparity, labels, gray;
};

float largestOf(const cv::Mat& map, const DisparityRange& range) {
  float largest = range.max;
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      if (range.isValid(map.at<float>(y, x))) largest = std::max(largest, map.at<float>(y, x));
    }
  }
  return largest;
}

void requireMap(const Frame& frame, const cv::Mat& refined) {
  require(refined.size() == frame.disparity.mat().size() && refined.type() == CV_32FC1,
          "the map has its size");
  // Measured disparities above the range are valid and stay.
  const float largest = largestOf(frame.disparity.mat(), frame.range);
  bool has_hole = false;
  for (int y = 0; y < refined.rows; ++y) {
    for (int x = 0; x < refined.cols; ++x) {
      const float d = refined.at<float>(y, x);
      const bool is_valid = frame.range.isValid(d);
      require(is_valid ? d <= largest : d == frame.range.invalid(),
              "every pixel is in range or has the invalid value");
      has_hole = has_hole || !is_valid;
    }
  }
  require(has_hole, "at least one pixel is invalid");
}

void requirePlanes(const Frame& frame, const DisparityRefinement& refinement) {
  const PlaneRefinementParameters& fit = frame.parameters.planes;
  int pixels = 0, largest = -1, in_segments = 0;
  for (int y = 0; y < frame.size.height; ++y) {
    for (int x = 0; x < frame.size.width; ++x) {
      largest = std::max(largest, frame.labels.mat().at<int>(y, x));
      in_segments += frame.labels.mat().at<int>(y, x) >= 0 ? 1 : 0;
    }
  }
  const std::vector<SegmentPlane>& fitted = refinement.fittedPlanes();
  require(static_cast<int>(fitted.size()) == largest + 1, "there is a plane for every label");
  for (const SegmentPlane& plane : fitted) {
    pixels += plane.pixels;
    require(plane.valid >= 0 && plane.valid <= plane.pixels, "the support is a part of the segment");
    require(plane.iterations >= 0 && plane.iterations <= fit.max_iterations, "the trials are bounded");
    const bool is_accepted = plane.status == PlaneStatus::ACCEPTED;
    require(is_accepted ? plane.inliers <= plane.valid : plane.inliers == 0,
            "inliers are a part of the support");
    require(std::isfinite(plane.a) && std::isfinite(plane.b) && std::isfinite(plane.c), "planes are finite");
    require(std::abs(plane.a) <= fit.max_slope_x && std::abs(plane.b) <= fit.max_slope_y,
            "slopes are bounded");
    require(is_accepted || (plane.a == 0.0 && plane.b == 0.0 && plane.c == 0.0), "no plane is 0");
  }
  require(pixels == in_segments, "every pixel is counted once");
  for (const SegmentPlane& plane : refinement.planes()) {
    require(std::isfinite(plane.a) && std::isfinite(plane.b) && std::isfinite(plane.c),
            "used planes are finite");
  }
}

void requireConfidence(Input& input, const Frame& frame, const DisparityRefinement& refinement,
                       const cv::Mat& refined) {
  Picture sources = input.picture(frame.size, CV_8UC1), confidence = input.picture(frame.size, CV_8UC1);
  findSources(frame.disparity.mat(), refined, frame.labels.mat(), frame.range, refinement.fittedPlanes(),
              sources.mat());
  findConfidence(sources.mat(), confidence.mat());
  for (int y = 0; y < refined.rows; ++y) {
    for (int x = 0; x < refined.cols; ++x) {
      const int source = sources.mat().at<std::uint8_t>(y, x);
      const bool is_none = source == static_cast<int>(DisparitySource::NONE);
      require(source < DISPARITY_SOURCES, "sources are those of the enumeration");
      require(is_none != frame.range.isValid(refined.at<float>(y, x)),
              "a pixel has a source if it has a disparity");
      require(!is_none || confidence.mat().at<std::uint8_t>(y, x) == 0, "there is no confidence in nothing");
    }
  }
}

void requireStatistics(const Frame& frame, const DisparityRefinement& refinement, const cv::Mat& refined) {
  const RefinementStatistics statistics =
      measureRefinement(frame.disparity.mat(), refined, frame.labels.mat(), frame.range, frame.f_times_t,
                        frame.parameters, refinement.fittedPlanes());
  const auto shareOf = [&frame](const cv::Mat& map) {
    int valid = 0;
    for (int y = 0; y < map.rows; ++y) {
      for (int x = 0; x < map.cols; ++x) valid += frame.range.isValid(map.at<float>(y, x)) ? 1 : 0;
    }
    return static_cast<double>(valid) / static_cast<double>(map.total());
  };
  require(
      statistics.valid_before == shareOf(frame.disparity.mat()) && statistics.valid_after == shareOf(refined),
      "shares are those of the valid pixels");
  const std::vector<SegmentPlane>& fitted = refinement.fittedPlanes();
  const auto isSegment = [](const SegmentPlane& plane) { return plane.pixels > 0; };
  require(statistics.segments == std::count_if(fitted.begin(), fitted.end(), isSegment),
          "segments are those with a pixel");
  // A plane is refused for one reason at more than half the pixels.
  const int refused = statistics.refused_by_depth_error + statistics.refused_by_divergence +
                      statistics.too_few_points + statistics.degenerate + statistics.max_iterations;
  require(refused <= statistics.segments, "a segment is refused for one reason at most");
}

}  // namespace

void test(Input& input) {
  DisparityRefinement refinement;
  const Frame frame(input);
  Picture refined = input.picture(frame.size, CV_32FC1);
  if (input.isWild() && input.oneIn(8))
    refined.mat() = input.yes() ? frame.disparity.mat() : frame.labels.mat();
  const cv::Mat before = refined.mat(), content = before.clone();
  if (!succeeds([&] { frame.refine(refinement, refined.mat()); })) {
    require(refined.mat().data == before.data && same(refined.mat(), content),
            "a refused output is not touched");
    return;
  }
  requireMap(frame, refined.mat());
  requirePlanes(frame, refinement);
  requireConfidence(input, frame, refinement, refined.mat());
  requireStatistics(frame, refinement, refined.mat());

  if (!input.oneIn(2)) return;
  // After another frame, and by two threads.
  const Frame other(input);
  cv::Mat again;
  succeeds([&] { other.refine(refinement, again); });
  const Threads threads(input.oneIn(3) ? 2 : 1);
  frame.refine(refinement, again);
  require(same(again, refined.mat()), "the same frame gives the same bits");
}

}  // namespace fuzz
}  // namespace disparity_refinement
