#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "CommandLine.hpp"
#include "Evaluation.hpp"
#include "EvaluationReport.hpp"
#include "FrameSelection.hpp"
#include "OutputFiles.hpp"
#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

namespace po = boost::program_options;

constexpr const char* USAGE =
    R"(Usage: evaluate TRAINING_DIR [options]

Scores the matcher alone and with the refinement on a folder in the layout of KITTI's
stereo 2012 benchmark (image_0, image_1, calib, disp_noc and/or disp_occ), with the metric
of its devkit. With --maps it scores the finished maps of any other method instead.
)";

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

/// The frames to score, and in `left_out` what is wrong with the others that were selected.
std::vector<KittiFrame> openFrames(const std::string& folder, bool with_images,
                                   const FrameSelection& selection, bool keep_going,
                                   std::vector<std::string>& left_out) {
  std::vector<IncompleteKittiFrame> incomplete;
  std::vector<KittiFrame> frames;
  if (with_images) {
    frames = openKittiDataset(folder, KittiCameras::GRAY, 10.0, &incomplete).frames;
    if (frames.front().disp_noc.empty() && frames.front().disp_occ.empty()) {
      throw std::runtime_error(folder + ": no ground truth, expected a folder disp_noc or disp_occ");
    }
  } else {
    frames = listGroundTruth(folder, &incomplete);
  }
  std::vector<std::string> names;
  for (const KittiFrame& frame : frames) names.push_back(frame.name);
  for (const IncompleteKittiFrame& frame : incomplete) names.push_back(frame.name);
  std::sort(names.begin(), names.end());
  selection.requireFrames(names);

  for (const IncompleteKittiFrame& frame : incomplete) {
    if (!selection.has(frame.name)) continue;
    if (!keep_going) throw std::runtime_error(frame.problem);
    left_out.push_back(frame.problem);
  }
  frames.erase(std::remove_if(frames.begin(), frames.end(),
                              [&](const KittiFrame& frame) { return !selection.has(frame.name); }),
               frames.end());
  return frames;
}

/// A step of the refinement beyond the paper, in the order in which they are made.
struct QualityStep {
  const char* name;
  void (*leaveOut)(QualityParameters&);
};

constexpr const char* FURTHER_SEGMENTATIONS = "further segmentations";

constexpr QualityStep QUALITY_STEPS[] = {
    {"plane selection", [](QualityParameters& p) { p.selection.sweeps = 0; }},
    {"plane smoothing", [](QualityParameters& p) { p.smoothing.sweeps = 0; }},
    {"pixel labeling", [](QualityParameters& p) { p.label_pixels = false; }},
    {"less weight behind edges", [](QualityParameters& p) { p.labeling.edge_share = 1.0; }},
    {FURTHER_SEGMENTATIONS, [](QualityParameters& p) { p.further.clear(); }},
    {"soft output", [](QualityParameters& p) { p.labeling.soft_reach = 0.0; }},
    {"medians", [](QualityParameters& p) { p.medians = 0; }},
};

/// The method with the first steps only, one row for every number of them, and then without one step alone.
std::vector<EvaluatedMethod> ablation(const EvaluatedMethod& complete) {
  std::vector<QualityStep> all_steps;
  for (const QualityStep& step : QUALITY_STEPS) {
    const bool is_made = std::string(step.name) != FURTHER_SEGMENTATIONS || !complete.quality.further.empty();
    if (is_made) all_steps.push_back(step);
  }
  std::vector<EvaluatedMethod> methods;
  const int steps = static_cast<int>(all_steps.size());
  for (int made = 0; made <= steps; ++made) {
    EvaluatedMethod method = complete;
    for (int i = made; i < steps; ++i) all_steps[i].leaveOut(method.quality);
    method.name = made == 0 ? complete.name + ": planes" : "+ " + std::string(all_steps[made - 1].name);
    methods.push_back(method);
  }
  for (const QualityStep& step : all_steps) {
    EvaluatedMethod method = complete;
    step.leaveOut(method.quality);
    method.name = "all without " + std::string(step.name);
    methods.push_back(method);
  }
  return methods;
}

bool isQuality(const StageParameters& parameters) {
  return parameters.refinement().mode == RefinementMode::QUALITY;
}

std::string refinedName(const StageParameters& parameters, const std::string& variant) {
  const SegmentationParameters segmentation = parameters.segmentation();
  const std::string settings =
      "(" + std::to_string(segmentation.lambda) + "," + std::to_string(segmentation.h) + ")";
  return matcherName(parameters.matching()) + " + " + (variant.empty() ? settings : variant);
}

/// The refinement with every variant of the parameters; before it, once for every matcher among them, the
/// matcher alone.
std::vector<EvaluatedMethod> makeMethods(const StageParameters& base, std::vector<std::string> variants,
                                         bool with_ablation) {
  if (variants.empty()) variants.emplace_back();
  std::vector<EvaluatedMethod> methods;
  for (const std::string& variant : variants) {
    EvaluatedMethod method;
    method.parameters = base;
    std::string matcher_settings;
    for (const std::string& assignment : split(variant, ',')) {
      const auto equals = assignment.find('=');
      requireArgument(equals != std::string::npos && equals > 0, "variant", variant,
                      "NAME=VALUE[,NAME=VALUE...]");
      const std::string name = assignment.substr(0, equals);
      method.parameters.set(name, assignment.substr(equals + 1));
      if (base.matchingValues().count(name) > 0) matcher_settings += ", " + assignment;
    }
    const bool is_known = std::any_of(methods.begin(), methods.end(), [&](const EvaluatedMethod& other) {
      return other.parameters.hasSameMatching(method.parameters);
    });
    if (!is_known) {
      EvaluatedMethod matcher = method;
      matcher.is_refined = false;
      matcher.name = matcherName(method.parameters.matching());
      if (!base.hasSameMatching(method.parameters)) matcher.name += matcher_settings;
      methods.push_back(matcher);
    }
    method.name = refinedName(method.parameters, variant);
    if (isQuality(method.parameters)) method.name += " quality";
    method.quality = method.parameters.refinement().quality;
    if (with_ablation) {
      if (!isQuality(method.parameters)) throw std::invalid_argument("--ablation is for --mode quality");
      const std::vector<EvaluatedMethod> steps = ablation(method);
      methods.insert(methods.end(), steps.begin(), steps.end());
    } else {
      methods.push_back(method);
    }
  }
  return methods;
}

/// Everything that has no meaning for finished maps.
void refuseWithMaps(const po::variables_map& values) {
  const auto refuse = [](const std::string& name) {
    throw std::invalid_argument("--" + name + " and --maps exclude each other");
  };
  for (const char* name : {"variant", "params", "mode", "write-maps", "pictures"}) {
    if (values.count(name) > 0) refuse(name);
  }
  if (!values["ablation"].defaulted()) refuse("ablation");
  if (!values["by-confidence"].defaulted()) refuse("by-confidence");
  for (const auto& parameter : StageParameters().values()) {
    if (values.count(parameter.first) > 0) refuse(parameter.first);
  }
}

void run(int argc, char** argv) {
  EvaluationOptions options;
  options.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  std::vector<std::string> variants;
  std::string frames, maps, name, json, csv;
  bool with_ablation = false;
  po::options_description description("Options");
  description.add_options()("frames", po::value(&frames)->value_name("LIST"),
                            "numbers of the frames, such as 0,4,100-120; default all")(
      "threads", po::value(&options.threads)->default_value(options.threads),
      "frames computed at the same time; the figures do not depend on it, the times are truest with 1")(
      "ablation", po::bool_switch(&with_ablation), "with --mode quality: its steps one after the other")(
      "by-confidence", po::bool_switch(&options.confidence),
      "errors by where refined disparities come from and by their confidence")(
      "variant", po::value(&variants)->value_name("NAME=VALUE[,NAME=VALUE...]"),
      "refine with these parameters instead; any number of times, all in one run")(
      "maps", po::value(&maps)->value_name("DIR"), "score the maps DIR/FRAME.png (KITTI's 16-bit PNG)")(
      "name", po::value(&name), "what to call the method of --maps; default the name of DIR")(
      "json", po::value(&json)->value_name("FILE"), "write the figures as JSON")(
      "csv", po::value(&csv)->value_name("FILE"), "write the figures of every frame as CSV")(
      "write-maps", po::value(&options.write_maps)->value_name("DIR"),
      "write the maps as KITTI's 16-bit PNG, DIR/METHOD/FRAME.png")(
      "pictures", po::value(&options.pictures)->value_name("DIR"),
      "write pictures of the refinements, DIR/METHOD/FRAME.png")(
      "keep-going", po::bool_switch(&options.keep_going), "leave out frames that cannot be scored");
  po::options_description parameters("Parameters, as for the nodelets");
  StageParameters::addOptions(parameters);
  description.add(parameters);
  po::variables_map values;
  if (!parseCommandLine(argc, argv, USAGE, {"TRAINING_DIR"}, description, values)) return;

  StageParameters base;
  base.readOptions(values);
  std::vector<EvaluatedMethod> methods;
  if (maps.empty()) {
    if (with_ablation && variants.size() > 1) throw std::invalid_argument("--ablation is for one variant");
    methods = makeMethods(base, variants, with_ablation);
    if (!name.empty()) throw std::invalid_argument("--name is for --maps");
  } else {
    refuseWithMaps(values);
    EvaluatedMethod method;
    method.maps = maps;
    method.name = name.empty() ? std::filesystem::path(maps + "/").parent_path().filename().string() : name;
    methods = {method};
  }
  for (const std::string& file : {json, csv}) {
    if (!file.empty()) requireWritable(file);
  }

  std::vector<std::string> left_out;
  const std::vector<KittiFrame> selected = openFrames(values["TRAINING_DIR"].as<std::string>(), maps.empty(),
                                                      FrameSelection(frames), options.keep_going, left_out);
  Evaluation evaluation;
  {
    ProgressLine progress;
    evaluation =
        evaluate(selected, methods, options, [&](int done, int total) { progress.show(done, total); });
  }
  evaluation.left_out.insert(evaluation.left_out.begin(), left_out.begin(), left_out.end());
  printTables(evaluation, std::cout);
  if (!json.empty()) writeJson(evaluation, json);
  if (!csv.empty()) writeCsv(evaluation, csv);
}

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  return disparity_refinement::runTool("evaluate", [&] { disparity_refinement::run(argc, argv); });
}
