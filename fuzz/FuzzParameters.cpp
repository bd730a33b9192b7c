// Parameters: YAML files and texts of the tools, lists of frames, and configurations as dynamic_reconfigure
// delivers them.

#include <dynamic_reconfigure/Config.h>

#include <fstream>
#include <string>
#include <vector>

#include "FrameSelection.hpp"
#include "Input.hpp"
#include "KittiFixture.hpp"
#include "StageParameters.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

std::string nameOf(Input& input) {
  static const auto values = StageParameters().values();
  if (input.oneIn(12)) return input.text(12);
  auto value = values.begin();
  std::advance(value, input.number(0, static_cast<int>(values.size()) - 1));
  return value->first;
}

std::string valueOf(Input& input) {
  switch (input.number(0, 4)) {
    case 0:
      return input.text(16);
    case 1:
      return std::to_string(input.number(-100, 300));
    case 2:
      return std::to_string(input.anyNumber<double>());
    case 3:
      return input.oneOf<std::string>({"true",  "false",      "yes",      "~",   "",      ".nan", ".inf",
                                       "-.inf", "1e3",        "0x10",     "010", "1_000", "[1]",  "{a: 1}",
                                       "*a",    "&a 5",       "!!int 5",  "'5'", "\"5\"", "|",    "? 5",
                                       "1.0",   "4294967296", "5 # five", "- 5"});
    default:
      return std::to_string(input.number(0, 16));
  }
}

std::string yamlOf(Input& input) {
  if (input.oneIn(4)) return input.bytes().ConsumeRemainingBytesAsString();
  std::string text;
  for (int section = input.number(1, 3); section > 0; --section) {
    text += input.oneOf<std::string>(
                {"disparity", "segmentation", "plane_refinement", "visualization", "<<", "? [1]"}) +
            ":" + input.oneOf<std::string>({"\n", "\n", "\n", " {", " ~\n", " &a\n", " *a\n", " [", " 5\n"});
    for (int i = input.number(0, 4); i > 0; --i) {
      text += "  " + nameOf(input) + ": " + valueOf(input) +
              input.oneOf<std::string>({"\n", "\n", "\n", ", ", "}\n", "]\n"});
    }
  }
  return text;
}

template <typename Read>
auto valuesOf(const Read& read) {
  bool is_good = false;
  decltype(read()) parameters;
  is_good = succeeds([&] { parameters = read(); });
  if (is_good) require(succeeds([&] { validate(parameters); }), "what a tool takes is valid");
  return is_good;
}

void testTools(Input& input) {
  static const TemporaryFolder folder;
  StageParameters parameters;
  succeeds(
      [&] {
        parameters.setMode(input.oneIn(4) ? input.text(8)
                                          : input.oneOf<std::string>({"paper", "fast", "quality"}));
      },
      "mode");
  if (input.yes()) {
    const std::string file = (folder / "parameters.yaml").string();
    std::ofstream(file, std::ios::binary) << yamlOf(input);
    succeeds<std::runtime_error>([&] { parameters.load(file); }, file);
  }
  for (int i = input.number(0, 6); i > 0; --i) {
    const std::string name = nameOf(input);
    succeeds([&] { parameters.set(name, valueOf(input)); }, name);
  }
  // Whatever was refused before has changed nothing, so that single values are in their ranges.
  const bool is_matching_good = valuesOf([&] { return parameters.matching(); });
  require(valuesOf([&] { return parameters.segmentation(); }) ||
              std::get<int>(parameters.values().at("connectivity")) % 4 != 0,
          "segmentation parameters are good one by one");
  require(valuesOf([&] { return parameters.refinement(); }), "refinement parameters are good one by one");
  require(!is_matching_good || !matcherName(parameters.matching()).empty(), "matchers have names");
}

void testFrames(Input& input) {
  std::vector<std::string> frames;
  for (int i = input.number(1, 5); i > 0; --i)
    frames.push_back(input.oneIn(6) ? input.text(12) : numbered(input.number(0, 200), 6, "_10"));
  std::sort(frames.begin(), frames.end());
  std::string list;
  for (int i = input.number(0, 6); i > 0; --i) {
    list += input.oneIn(8) ? input.text(6) : std::to_string(input.number(0, 200));
    list += input.oneOf<std::string>({",", ",", "-", "", " "});
  }
  std::unique_ptr<FrameSelection> selection;
  if (!succeeds([&] { selection = std::make_unique<FrameSelection>(list); }, "frames")) return;
  if (!succeeds([&] { selection->requireFrames(frames); }, "frames")) return;
  require(std::any_of(frames.begin(), frames.end(),
                      [&](const std::string& frame) { return selection->has(frame); }),
          "what is selected is there");
}

// The values of any configuration message, through what a nodelet does with it.
template <typename Config>
auto configured(Input& input) {
  dynamic_reconfigure::Config message;
  Config::__getDefault__().__toMessage__(message);
  for (auto& value : message.ints) {
    if (input.oneIn(3))
      value.value = input.yes() ? input.bytes().ConsumeIntegral<int>() : input.number(-1, 300);
  }
  for (auto& value : message.doubles) {
    if (input.oneIn(3)) value.value = input.anyNumber<double>();
  }
  for (auto& value : message.bools) value.value = input.bytes().ConsumeIntegral<std::uint8_t>();
  if (input.oneIn(8) && !message.ints.empty())
    message.ints.erase(message.ints.begin() + input.number(0, static_cast<int>(message.ints.size()) - 1));
  if (input.oneIn(8) && !message.doubles.empty()) message.doubles.pop_back();
  Config config = Config::__getDefault__();
  config.__fromMessage__(message);
  config.__clamp__();
  replaceNan(config);
  const auto parameters = toParameters(config);
  Config again = config;
  toParameters(again);
  dynamic_reconfigure::Config shown, shown_again;
  config.__toMessage__(shown);
  again.__toMessage__(shown_again);
  require(shown.ints == shown_again.ints && shown.doubles == shown_again.doubles,
          "what is in force is not changed once more");
  return parameters;
}

void testConfigurations(Input& input) {
  const MatchingParameters matching = configured<DisparityConfig>(input);
  // The one condition that no single value can be blamed for.
  succeeds([&] { validate(matching); }, "P2");
  require(succeeds([&] { validate(configured<SegmentationConfig>(input)); }),
          "segmentation parameters are valid");
  require(succeeds([&] { validate(configured<PlaneRefinementConfig>(input)); }),
          "refinement parameters are valid");
  const VisualizationConfig scale = configured<VisualizationConfig>(input);
  require(scale.color_min_disparity < scale.color_max_disparity, "the scale is not empty");
}

}  // namespace

void test(Input& input) {
  switch (input.number(0, 3)) {
    case 0:
      testFrames(input);
      break;
    case 1:
      testConfigurations(input);
      break;
    default:
      testTools(input);
  }
}

}  // namespace fuzz
}  // namespace disparity_refinement
