#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <limits>
#include <optional>
#include <set>
#include <vector>

#include "CommandLine.hpp"
#include "OutputFiles.hpp"
#include "PointCloudFile.hpp"
#include "StageParameters.hpp"
#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/evaluation/KittiFiles.hpp"
#include "disparity_refinement/refinement/Confidence.hpp"
#include "disparity_refinement/visualization/Colorize.hpp"
#include "disparity_refinement/visualization/RefinementPicture.hpp"

namespace disparity_refinement {
namespace {

namespace po = boost::program_options;

constexpr const char* USAGE =
    R"(Usage: refine LEFT RIGHT [options]

Computes the refined disparity map of one rectified stereo pair. Without an option that
says what to write, it writes disparity_refined.png (KITTI's 16-bit PNG) and
disparity_refined_color.png. Focal length and baseline are needed for the point cloud and
the bound on the depth error, condition 1; without them the bound is off.
)";

constexpr const char* DEFAULT_PNG = "disparity_refined.png";
constexpr const char* DEFAULT_COLOR = "disparity_refined_color.png";

struct Calibration {
  ProjectionMatrix left{};
  StereoGeometry geometry;
};

struct Outputs {
  std::string png, color, pfm, ply, picture, source, confidence;
  std::optional<float> color_max;  ///< Near end of the colour scale [px]

  /// Throws std::invalid_argument unless every name has the ending of its format and is another one.
  void validate() const {
    const auto require_ending = [](const std::string& option, const std::string& file,
                                   const std::string& ending) {
      requireArgument(file.empty() || std::filesystem::path(file).extension() == ending, option, file,
                      "a file name that ends with " + ending);
    };
    require_ending("output", png, ".png");
    require_ending("pfm", pfm, ".pfm");
    require_ending("ply", ply, ".ply");
    require_ending("source-map", source, ".png");
    require_ending("confidence-map", confidence, ".png");
    std::set<std::string> names;
    for (const std::string& file : all()) {
      if (!file.empty() && !names.insert(file).second) {
        throw std::invalid_argument(file + " is the name of two outputs");
      }
    }
  }

  std::vector<std::string> all() const { return {png, color, pfm, ply, picture, source, confidence}; }

  bool any() const {
    const std::vector<std::string> files = all();
    return std::any_of(files.begin(), files.end(), [](const std::string& file) { return !file.empty(); });
  }
};

/// The matrices of a KITTI calibration file, as the odometry data and the benchmark or as the raw data name
/// them.
Calibration readCalibration(const std::string& file) {
  Calibration calibration;
  ProjectionMatrix right{};
  try {
    calibration.left = readProjectionMatrix(file, "P0");
    right = readProjectionMatrix(file, "P1");
  } catch (const std::runtime_error& error) {
    try {
      calibration.left = readProjectionMatrix(file, "P_rect_00");
      right = readProjectionMatrix(file, "P_rect_01");
    } catch (const std::runtime_error&) {
      throw error;
    }
  }
  calibration.geometry = stereoGeometry(calibration.left, right);
  return calibration;
}

std::optional<Calibration> calibrationOf(const po::variables_map& values, const cv::Size& size) {
  const bool has_focal_length = values.count("focal-length") > 0, has_baseline = values.count("baseline") > 0;
  if (values.count("calibration") > 0) {
    if (has_focal_length || has_baseline) {
      throw std::invalid_argument("--calibration excludes --focal-length and --baseline");
    }
    return readCalibration(values["calibration"].as<std::string>());
  }
  if (has_focal_length != has_baseline) {
    throw std::invalid_argument("--focal-length and --baseline need each other");
  }
  if (!has_focal_length) return std::nullopt;
  const double f = values["focal-length"].as<double>(), baseline = values["baseline"].as<double>();
  const double cx = 0.5 * (size.width - 1), cy = 0.5 * (size.height - 1);
  Calibration calibration;
  calibration.left = {f, 0, cx, 0, 0, f, cy, 0, 0, 0, 1, 0};
  calibration.geometry = stereoGeometry(calibration.left, {f, 0, cx, -f * baseline, 0, f, cy, 0, 0, 0, 1, 0});
  return calibration;
}

/// Unknown disparities are infinite there, as in Middlebury's files.
void writePfm(const std::string& file, const cv::Mat& disparity, const DisparityRange& range) {
  cv::Mat map = disparity.clone();
  for (float& d : cv::Mat_<float>(map)) {
    if (!range.isValid(d)) d = std::numeric_limits<float>::infinity();
  }
  writeImageFile(file, map);
}

void refinePair(const std::string& left_file, const std::string& right_file, StageParameters& parameters,
                const po::variables_map& values, Outputs outputs) {
  const cv::Mat left = readGrayImage(left_file), right = readGrayImage(right_file);
  requireSizeOfLeftImage(right_file, right, left.size());
  const std::optional<Calibration> calibration = calibrationOf(values, left.size());
  outputs.validate();
  if (!outputs.ply.empty() && !calibration) {
    throw std::invalid_argument("--ply needs --calibration, or --focal-length and --baseline");
  }
  if (!outputs.any()) {
    outputs.png = DEFAULT_PNG;
    outputs.color = DEFAULT_COLOR;
  }
  if (!calibration) {
    const double bound = parameters.refinement().planes.disparity_error;
    requireArgument(bound == PlaneRefinementParameters().disparity_error || bound == 0.0, "disparity_error",
                    bound, "--calibration, or --focal-length and --baseline, beside it");
    parameters.set("disparity_error", "0");
  }
  const StereoGeometry geometry = calibration ? calibration->geometry : StereoGeometry{1.0, 1.0, 0.0};

  RefinementPicture result;
  StereoMatcher matcher(parameters.matching());
  matcher.compute(left, right, result.disparity, geometry.principal_point_offset);
  const DisparityRange range = matcher.range(geometry.principal_point_offset);
  const float color_max = outputs.color_max.value_or(std::max(64.0F, range.min + 64.0F));
  requireArgument(std::isfinite(color_max) && color_max > range.min, "color-max", color_max,
                  "a number above the smallest disparity, " + std::to_string(range.min));
  const int segments = Segmentation().compute(left, parameters.segmentation(), result.labels);
  DisparityRefinement refinement;
  refinement.refine(result.disparity, result.labels, left, range, geometry.focal_length * geometry.baseline,
                    parameters.refinement(), result.refined);
  result.disparity_range = result.refined_range = range;

  // Told when everything is written.
  std::string text = std::to_string(segments) + " segments\n";
  if (!calibration) text += "no focal length and baseline: condition 1 is off\n";
  const auto tell = [&text](const std::string& file, const std::string& what) {
    text += file + ": " + what + "\n";
  };
  if (!outputs.png.empty()) {
    writeDisparityPng(outputs.png, result.refined, range);
    tell(outputs.png, "disparity * 256, 0 where unknown");
  }
  if (!outputs.color.empty()) {
    cv::Mat bgr;
    colorizeDisparity(result.refined, range, range.min, color_max, bgr);
    writeImageFile(outputs.color, bgr);
    tell(outputs.color, "disparity in colours, black where unknown");
  }
  if (!outputs.pfm.empty()) {
    writePfm(outputs.pfm, result.refined, range);
    tell(outputs.pfm, "disparity [px], infinite where unknown");
  }
  if (!outputs.ply.empty()) {
    const int points =
        writePly(outputs.ply, result.refined, range, readColorImage(left_file), calibration->left, geometry);
    tell(outputs.ply, std::to_string(points) + " points");
  }
  if (!outputs.picture.empty()) {
    result.image = left;
    result.scale_max = color_max;
    writeImageFile(outputs.picture, drawRefinement(result));
    tell(outputs.picture, "image, segments, disparity before and after");
  }
  if (!outputs.source.empty() || !outputs.confidence.empty()) {
    cv::Mat sources, confidence;
    findSources(result.disparity, result.refined, result.labels, range, refinement.fittedPlanes(), sources);
    findConfidence(sources, confidence);
    if (!outputs.source.empty()) {
      writeImageFile(outputs.source, sources);
      tell(outputs.source,
           "source of every disparity, 0 none, 1 measured, 2 own plane, 3 neighbour's, 4 filled");
    }
    if (!outputs.confidence.empty()) {
      writeImageFile(outputs.confidence, confidence);
      tell(outputs.confidence, "confidence in every disparity, 0 ... 255");
    }
  }
  std::cout << text;
}

void run(int argc, char** argv) {
  Outputs outputs;
  const auto file_value = [](std::string& file) { return po::value(&file)->value_name("FILE"); };
  po::options_description description("Options");
  description.add_options()("output,o", file_value(outputs.png), "refined disparity as KITTI's 16-bit PNG")(
      "color", file_value(outputs.color), "refined disparity in colours")(
      "pfm", file_value(outputs.pfm), "refined disparity as PFM")("ply", file_value(outputs.ply),
                                                                  "point cloud as PLY")(
      "source-map", file_value(outputs.source), "where every disparity comes from, 0 ... 4, as PNG")(
      "confidence-map", file_value(outputs.confidence), "confidence in every disparity, 0 ... 255, as PNG")(
      "picture", file_value(outputs.picture), "image, segments, disparity before and after in one picture")(
      "color-max", po::value<float>()->notifier([&outputs](float value) { outputs.color_max = value; }),
      "disparity at the near end of the colour scale [px]; by default 64, or 64 above a positive "
      "min_disparity")("calibration", po::value<std::string>()->value_name("FILE"),
                       "KITTI calibration file with P0 and P1, or P_rect_00 and P_rect_01")(
      "focal-length", po::value<double>()->value_name("PX"),
      "of both images [px], which are taken as centred")("baseline", po::value<double>()->value_name("M"),
                                                         "distance of the cameras [m]");
  po::options_description parameter_options("Parameters, as for the nodelets");
  StageParameters::addOptions(parameter_options);
  description.add(parameter_options);
  po::variables_map values;
  if (!parseCommandLine(argc, argv, USAGE, {"LEFT", "RIGHT"}, description, values)) return;
  StageParameters parameters;
  parameters.readOptions(values);
  refinePair(values["LEFT"].as<std::string>(), values["RIGHT"].as<std::string>(), parameters, values,
             outputs);
}

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  return disparity_refinement::runTool("refine", [&] { disparity_refinement::run(argc, argv); });
}
