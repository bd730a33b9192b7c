#pragma once

#include <array>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "StageParameters.hpp"
#include "disparity_refinement/evaluation/KittiDataset.hpp"
#include "disparity_refinement/evaluation/KittiMetric.hpp"
#include "disparity_refinement/refinement/Confidence.hpp"
#include "disparity_refinement/refinement/QualityRefinement.hpp"

namespace disparity_refinement {

/// What makes a disparity map: a folder of finished maps, or the core with these parameters.
struct EvaluatedMethod {
  std::string name;
  std::string maps;            ///< Folder with FRAME.png, KITTI's 16-bit PNG; empty: the maps are computed.
  StageParameters parameters;  ///< Of a computed method.
  bool is_refined = true;  ///< Of a computed method: with segmentation and refinement, or the matcher alone.
  QualityParameters quality;  ///< Of a refined method, instead of that in `parameters`.

  bool isComputed() const { return maps.empty(); }
  bool isRefined() const { return isComputed() && is_refined; }
};

/// Time of the stages [ms].
struct StageTimes {
  double matching = 0.0, segmentation = 0.0, refinement = 0.0;

  double total() const { return matching + segmentation + refinement; }
};

/// How many refined disparities are wrong, by what is said of them. Disparities alone: holes that are
/// interpolated for the scores do not count.
struct ConfidenceFigures {
  static constexpr int BINS = 8;     ///< Of confidence, 256 / BINS levels each.
  static constexpr float WRONG = 3;  ///< Error beyond which a disparity is wrong [px].

  struct Count {
    long pixels = 0, wrong = 0;
  };
  std::array<Count, DISPARITY_SOURCES> by_source;
  std::array<Count, BINS> by_confidence;

  void add(const cv::Mat& refined, const cv::Mat& sources, const cv::Mat& confidence, const cv::Mat& truth);
  void add(const ConfidenceFigures& other);
};

/// Figures of one method on one frame, or their mean.
struct EvaluationFigures {
  std::map<std::string, KittiScore> scores;  ///< By the kind of ground truth, "noc" and "occ".
  double segments = 0.0;                     ///< 0 without a segmentation.
  StageTimes ms;                             ///< 0 for a stage that was not run.
  ConfidenceFigures confidence;  ///< With EvaluationOptions::confidence; of all frames in the mean.
};

struct EvaluationOptions {
  int threads = 1;          ///< Frames computed at the same time, >= 1.
  bool keep_going = false;  ///< Leave a frame that fails out instead of throwing.
  bool confidence = false;  ///< Count errors by source and confidence of refined disparities.
  std::string write_maps;   ///< Folder for the maps of every method, METHOD/FRAME.png; empty: none.
  std::string pictures;     ///< Folder for pictures of every refined method, METHOD/FRAME.png; empty: none.
};

struct Evaluation {
  std::vector<EvaluatedMethod> methods;
  std::vector<std::string> frames;    ///< Names of the frames that were scored.
  std::vector<std::string> left_out;  ///< What was wrong with the others.
  /// figures[m][i]: method m on frame i.
  std::vector<std::vector<EvaluationFigures>> figures;

  /// Mean over the frames, as KITTI's devkit takes it.
  EvaluationFigures mean(std::size_t method) const;
};

/// Scores methods on the frames of a stereo benchmark folder with ground truth; finished maps need no images.
/// The map that is scored has the values that its PNG would hold, so that the figures are those of the
/// devkit.
///
/// The figures but the times do not depend on the number of threads. A frame's matching is computed once for
/// consecutive methods with the same matcher, and so is its segmentation; each of them is given its time.
///
/// @param progress  Called after every frame with the numbers of frames done and to do, by one thread at a
/// time. Throws std::runtime_error that names the file, std::invalid_argument for bad parameters; with
/// keep_going only if no frame could be scored.
Evaluation evaluate(
    const std::vector<KittiFrame>& frames, const std::vector<EvaluatedMethod>& methods,
    const EvaluationOptions& options, const std::function<void(int, int)>& progress = [](int, int) {});

/// A method's name as the name of a folder: spaces, slashes, brackets and the like become one '_'.
std::string folderName(const std::string& method);

}  // namespace disparity_refinement
