#include <algorithm>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <thread>

#include "CommandLine.hpp"
#include "Evaluation.hpp"
#include "EvaluationReport.hpp"
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

int parseNumber(const std::string& text, const std::string& list) {
  const bool is_number =
      !text.empty() && text.size() < 9 && text.find_first_not_of("0123456789") == std::string::npos;
  requireArgument(is_number, "frames", list, "numbers and ranges such as 0,4,100-120");
  return std::stoi(text);
}

/// The frames whose numbers are in a list such as "0,4,100-120".
std::vector<KittiFrame> selectFrames(const std::vector<KittiFrame>& frames, const std::string& list) {
  std::vector<KittiFrame> selected;
  const auto number_of = [](const KittiFrame& frame) { return std::atoi(frame.name.c_str()); };
  for (const std::string& part : split(list, ',')) {
    const auto dash = part.find('-');
    const int first = parseNumber(part.substr(0, dash), list);
    const int last = dash == std::string::npos ? first : parseNumber(part.substr(dash + 1), list);
    const std::size_t before = selected.size();
    std::copy_if(frames.begin(), frames.end(), std::back_inserter(selected), [&](const KittiFrame& frame) {
      return number_of(frame) >= first && number_of(frame) <= last;
    });
    requireArgument(selected.size() > before, "frames", part,
                    "numbers of frames, which are " + std::to_string(number_of(frames.front())) + " ... " +
                        std::to_string(number_of(frames.back())) + " here");
  }
  requireArgument(!selected.empty(), "frames", list, "numbers and ranges such as 0,4,100-120");
  const auto by_name = [](const KittiFrame& a, const KittiFrame& b) { return a.name < b.name; };
  const auto same_name = [](const KittiFrame& a, const KittiFrame& b) { return a.name == b.name; };
  std::sort(selected.begin(), selected.end(), by_name);
  selected.erase(std::unique(selected.begin(), selected.end(), same_name), selected.end());
  return selected;
}

std::string refinedName(const StageParameters& parameters, const std::string& variant) {
  const SegmentationParameters segmentation = parameters.segmentation();
  const std::string settings =
      "(" + std::to_string(segmentation.lambda) + "," + std::to_string(segmentation.h) + ")";
  return matcherName(parameters.matching()) + " + " + (variant.empty() ? settings : variant);
}

/// The refinement with every variant of the parameters; before it, once for consecutive variants with the
/// same one, the matcher alone.
std::vector<EvaluatedMethod> makeMethods(const StageParameters& base, std::vector<std::string> variants) {
  if (variants.empty()) variants.emplace_back();
  std::vector<EvaluatedMethod> methods;
  for (const std::string& variant : variants) {
    EvaluatedMethod method;
    method.parameters = base;
    for (const std::string& assignment : split(variant, ',')) {
      const auto equals = assignment.find('=');
      requireArgument(equals != std::string::npos, "variant", variant, "NAME=VALUE[,NAME=VALUE...]");
      method.parameters.set(assignment.substr(0, equals), assignment.substr(equals + 1));
    }
    if (methods.empty() || !methods.back().parameters.hasSameMatching(method.parameters)) {
      EvaluatedMethod matcher = method;
      matcher.is_refined = false;
      matcher.name = matcherName(method.parameters.matching());
      if (!base.hasSameMatching(method.parameters)) matcher.name += ", " + variant;
      methods.push_back(matcher);
    }
    method.name = refinedName(method.parameters, variant);
    methods.push_back(method);
  }
  return methods;
}

void run(int argc, char** argv) {
  EvaluationOptions options;
  options.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  std::vector<std::string> variants;
  std::string frames, maps, name, json, csv;
  po::options_description description("Options");
  description.add_options()("frames", po::value(&frames)->value_name("LIST"),
                            "numbers of the frames, such as 0,4,100-120; default all")(
      "threads", po::value(&options.threads)->default_value(options.threads),
      "frames computed at the same time; the figures do not depend on it, the times are truest with 1")(
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
    methods = makeMethods(base, variants);
  } else {
    if (!variants.empty()) throw std::invalid_argument("--variant and --maps exclude each other");
    EvaluatedMethod method;
    method.maps = maps;
    method.name = name.empty() ? std::filesystem::path(maps + "/").parent_path().filename().string() : name;
    methods = {method};
  }

  const auto folder = values["TRAINING_DIR"].as<std::string>();
  std::vector<std::string> incomplete;
  KittiDataset dataset =
      openKittiDataset(folder, KittiCameras::GRAY, 10.0, options.keep_going ? &incomplete : nullptr);
  if (dataset.frames.front().disp_noc.empty() && dataset.frames.front().disp_occ.empty()) {
    throw std::runtime_error(folder + ": no ground truth, expected a folder disp_noc or disp_occ");
  }
  if (!frames.empty()) dataset.frames = selectFrames(dataset.frames, frames);

  Evaluation evaluation;
  {
    ProgressLine progress;
    evaluation =
        evaluate(dataset.frames, methods, options, [&](int done, int total) { progress.show(done, total); });
  }
  evaluation.left_out.insert(evaluation.left_out.begin(), incomplete.begin(), incomplete.end());
  printTables(evaluation, std::cout);
  if (!json.empty()) writeJson(evaluation, json);
  if (!csv.empty()) writeCsv(evaluation, csv);
}

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  return disparity_refinement::runTool("evaluate", [&] { disparity_refinement::run(argc, argv); });
}
