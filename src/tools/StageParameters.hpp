#pragma once

#include <boost/program_options.hpp>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "disparity_refinement/DisparityConfig.h"
#include "disparity_refinement/PlaneRefinementConfig.h"
#include "disparity_refinement/SegmentationConfig.h"
#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {

/// The live parameters of matcher, segmentation and refinement for tools that run without a master. Names,
/// ranges and defaults are those of cfg/: the same generated classes as in the nodelets.
///
/// Where a nodelet moves a bad value to the nearest allowed one and warns, a tool refuses it.
class StageParameters {
 public:
  using Value = std::variant<bool, int, double>;

  /// Sets what the launch files' argument `mode` stands for: "paper", "fast" or "quality". Throws
  /// std::invalid_argument for other texts.
  void setMode(const std::string& mode);

  /// Sets one parameter from its text. Throws std::invalid_argument that names parameter, value and range.
  void set(const std::string& name, const std::string& value);

  /// Reads a YAML file as the launch files take it for `params`: parameters by the nodelets disparity,
  /// segmentation and plane_refinement. Throws std::runtime_error that names the file.
  ///
  /// @return  What is in the file and no parameter here, such as queue_size or a nodelet without a stage.
  std::vector<std::string> load(const std::string& file);

  /// Each throws std::invalid_argument if the values do not fit to each other.
  MatchingParameters matching() const;
  SegmentationParameters segmentation() const;
  RefinementParameters refinement() const;

  /// The values by their names.
  std::map<std::string, Value> values() const;
  std::map<std::string, Value> matchingValues() const;

  bool hasSameMatching(const StageParameters& other) const;
  bool hasSameSegmentation(const StageParameters& other) const;

  /// One option for every parameter under its name, `params` for a YAML file and `mode`.
  static void addOptions(boost::program_options::options_description& description);
  /// The same for the segmentation alone, without what the tool sets itself: lambda and h.
  static void addSegmentationOptions(boost::program_options::options_description& description);
  /// Sets the mode, loads the file, then sets what the command line has; warns on stderr about what in the
  /// file is unknown.
  void readOptions(const boost::program_options::variables_map& options);

 private:
  DisparityConfig disparity_ = DisparityConfig::__getDefault__();
  SegmentationConfig segmentation_ = SegmentationConfig::__getDefault__();
  PlaneRefinementConfig plane_refinement_ = PlaneRefinementConfig::__getDefault__();
};

/// "BM", "SGBM", "SGBM HH" or the like for SGBM's modes, "census SGM".
std::string matcherName(const MatchingParameters& parameters);

}  // namespace disparity_refinement
