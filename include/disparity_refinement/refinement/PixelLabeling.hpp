#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/refinement/SegmentGraph.hpp"
#include "disparity_refinement/refinement/SegmentRuns.hpp"
#include "disparity_refinement/refinement/SegmentSupport.hpp"

namespace disparity_refinement {

/// Parameters of PixelLabeling. Costs are in pixels of disparity error that cost as much.
struct PixelLabelingParameters {
  /// Cost of a pixel of distance to the measured disparity, 0...10, and the distance beyond which it costs no
  /// more [px], > 0 and at most 16; their product is at most 15.
  double data_weight = 1.3;
  double data_truncation = 2.0;
  /// The far side of a depth step is measured less reliably: share of data_weight that counts, 0...1, where
  /// within edge_reach [px] in x and y, 0...16, something was measured that is nearer by more than edge_step
  /// [px], >= 0. A share of 1 or a reach of 0: the step is left out.
  double edge_share = 0.25;
  int edge_reach = 3;
  double edge_step = 3.0;
  /// Cost of a neighbour's plane, 0...100, where the pixel has a measured disparity and where it has none.
  double neighbour_cost = 1.2;
  double neighbour_cost_in_hole = 0.5;
  /// The same for the planes of further segmentations.
  double further_cost = 0.5;
  double further_cost_in_hole = 0.25;
  /// Cost of keeping the measured disparity, 0...100.
  double measured_cost = 1.5;
  /// Cost of a disparity that leads to a place where the right camera sees something farther, 0...100: what
  /// is nearer would hide that.
  double visibility_cost = 1.0;
  /// Cost of a pixel of step between two pixels of the same gray value, 0...15, the difference of gray values
  /// at which it is half, > 0, and the step beyond which it costs no more [px], > 0 and at most 16. The
  /// largest cost of a step, the product of the first and the last, is at most 15.
  double smoothness = 2.0;
  double half_contrast = 10.0;
  double step_truncation = 4.0;
  /// Candidates near the best one take part in the result: those within soft_reach [px], 0...1000, with a
  /// weight that halves with every half_cost by which they are dearer, > 0 and at most 100.
  double soft_reach = 4.0;
  double half_cost = 1.5;
};

/// Planes of another segmentation of the same image.
struct FurtherPlanes {
  const cv::Mat* labels;                      ///< CV_32SC1; negative labels belong to no segment.
  const std::vector<DisparityPlane>* planes;  ///< One a label.
};

/// Chooses the disparity of every pixel among few candidates: the planes of its segment, of the segments of
/// further segmentations that it is in, and of the neighbours with the longest borders, up to 7 planes in
/// this order, and the measured disparity.
///
/// The sum of the costs of the pixels and of the steps between them is made small as in semi-global matching,
/// but with candidates instead of disparities: along four paths, L(p, i) = C(p, i) + min over j of (L(q, j) +
/// step cost(p, i, q, j)) less the least of them, and the candidate with the least sum of the four wins. The
/// result is the weighted mean of the winner and the candidates near it.
///
/// Planes that differ by less than 1/2 px are one candidate: neighbours' planes all over the segment, and any
/// planes on a stretch of a row where no label changes. So is a measured disparity within 1/2 px of the first
/// plane: many pixels of roads and walls have one candidate only.
///
/// Works in steps of 1/16 px in 16 bits: what is more than 2047 px above the least disparity is cut there.
/// The same bits for any number of threads. Buffers are kept between frames.
class PixelLabeling {
 public:
  /// @param measured  CV_32FC1 [px]; every pixel is valid or range.invalid().
  /// @param gray      CV_8UC1 of the same size.
  /// @param planes    One a segment.
  /// @param further   Of the same size; may be empty.
  /// @param result    CV_32FC1 of the same size, allocated; range.invalid() for pixels without candidates.
  ///                  Pixels of no segment keep what was measured.
  void compute(const cv::Mat& measured, const cv::Mat& gray, const DisparityRange& range,
               const SegmentRuns& segments, const SegmentGraph& graph,
               const std::vector<DisparityPlane>& planes, const std::vector<FurtherPlanes>& further,
               const PixelLabelingParameters& parameters, cv::Mat& result);

 private:
  // Buffers of a strip.
  struct Strip {
    std::vector<SegmentGraph::Border> borders;
    std::vector<short> path;
  };

  void mirror(const cv::Mat& measured, const DisparityRange& range, int strips);
  void findNearest(const cv::Mat& measured, int reach, int strips);
  void findCandidates(const cv::Mat& measured, const DisparityRange& range, const SegmentRuns& segments,
                      const SegmentGraph& graph, const std::vector<DisparityPlane>& planes,
                      const std::vector<FurtherPlanes>& further, const PixelLabelingParameters& parameters,
                      int label, Strip& strip);
  void addPaths(const cv::Mat& gray, const PixelLabelingParameters& parameters, int strips);
  void choose(const cv::Mat& measured, const DisparityRange& range, const PixelLabelingParameters& parameters,
              int strips, cv::Mat& result) const;

  cv::Mat right_;                // The measured map as the right camera sees it.
  cv::Mat nearest_in_row_;       // Largest of what was measured within reach, in x,
  cv::Mat nearest_;              // and in x and y.
  cv::Mat disparities_, costs_;  // Of the candidates of every pixel [1/16 px].
  cv::Mat sums_;                 // Of the four paths.
  cv::Mat numbers_;              // Of candidates.
  std::vector<float> weights_;   // Of candidates in the result, by how much dearer their sums are.
  std::vector<Strip> strips_;
};

}  // namespace disparity_refinement
