#include "StageParameters.hpp"

#include <yaml-cpp/yaml.h>

#include <cstdio>
#include <set>
#include <sstream>
#include <stdexcept>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"

namespace disparity_refinement {
namespace {

namespace po = boost::program_options;
using ConfigMessage = dynamic_reconfigure::Config;

/// dynamic_reconfigure has bools, integers, floating-point numbers and strings; there is no string among
/// ours.
template <class Visitor>
void forEachValue(ConfigMessage& message, const Visitor& visit) {
  for (auto& entry : message.bools) visit(entry.name, entry.value, bool());
  for (auto& entry : message.ints) visit(entry.name, entry.value, int());
  for (auto& entry : message.doubles) visit(entry.name, entry.value, double());
}

template <class Config>
ConfigMessage toMessage(const Config& config) {
  ConfigMessage message;
  config.__toMessage__(message);
  return message;
}

std::map<std::string, StageParameters::Value> toValues(ConfigMessage message) {
  std::map<std::string, StageParameters::Value> values;
  forEachValue(message, [&](const std::string& name, auto value, auto type) {
    values[name] = static_cast<decltype(type)>(value);
  });
  return values;
}

template <class Config>
std::map<std::string, StageParameters::Value> toValues(const Config& config) {
  return toValues(toMessage(config));
}

std::string toText(const StageParameters::Value& value) {
  std::ostringstream text;
  text << std::boolalpha;
  std::visit([&text](auto v) { text << v; }, value);
  return text.str();
}

template <class Config>
bool isKnown(const std::string& name) {
  return toValues(Config::__getDefault__()).count(name) > 0;
}

/// "true or false", "an integer in 0 ... 255"
template <class Config>
std::string expectation(const std::string& name) {
  const StageParameters::Value min = toValues(Config::__getMin__()).at(name);
  if (std::holds_alternative<bool>(min)) return "true or false";
  return std::string(std::holds_alternative<int>(min) ? "an integer" : "a number") + " in " + toText(min) +
         " ... " + toText(toValues(Config::__getMax__()).at(name));
}

/// @return  Whether the configuration has such a parameter.
template <class Config>
bool setIfKnown(Config& config, const std::string& name, const YAML::Node& value) {
  if (!isKnown<Config>(name)) return false;
  ConfigMessage message = toMessage(config);
  bool is_good = value.IsScalar();
  forEachValue(message, [&](const std::string& entry, auto& field, auto type) {
    using Type = decltype(type);
    if (entry != name || !is_good) return;
    Type number{};
    is_good = YAML::convert<Type>::decode(value, number);
    // 010 would be octal.
    if constexpr (std::is_same_v<Type, int>) is_good = is_good && value.Scalar() == std::to_string(number);
    if constexpr (!std::is_same_v<Type, bool>) {
      // Written so that NaN is refused.
      is_good = is_good && number >= std::get<Type>(toValues(Config::__getMin__()).at(name)) &&
                number <= std::get<Type>(toValues(Config::__getMax__()).at(name));
    }
    if (is_good) field = number;
  });
  if (!is_good) {
    const std::string text = value.IsScalar() ? value.Scalar() : "no single value";
    throw std::invalid_argument(name + " is " + text + ", expected " + expectation<Config>(name));
  }
  config.__fromMessage__(message);
  return true;
}

/// toParameters() replaces what no single range can exclude.
template <class Config>
auto checkedParameters(const Config& config) {
  Config allowed = config;
  const auto parameters = toParameters(allowed);
  for (const auto& [name, value] : toValues(allowed)) {
    const StageParameters::Value asked = toValues(config).at(name);
    if (asked != value) {
      throw std::invalid_argument(name + " is " + toText(asked) + ", the nearest allowed value is " +
                                  toText(value));
    }
  }
  validate(parameters);
  return parameters;
}

template <class Config>
void loadSection(const YAML::Node& section, const std::string& name, Config& config,
                 std::vector<std::string>& unknown) {
  if (section.IsNull()) return;
  if (!section.IsMap()) throw std::invalid_argument(name + " is no map of parameters");
  for (const auto& entry : section) {
    const auto key = entry.first.as<std::string>();
    if (!setIfKnown(config, key, entry.second)) unknown.push_back(name + "/" + key);
  }
}

void addFileOption(po::options_description& description) {
  description.add_options()("params", po::value<std::string>()->value_name("FILE"),
                            "YAML file with parameters, as the launch files take it; options win over it");
}

template <class Config>
void addConfigOptions(po::options_description& description, const std::set<std::string>& without = {}) {
  const auto defaults = toValues(Config::__getDefault__());
  for (const auto& parameter : Config::__getParamDescriptions__()) {
    if (without.count(parameter->name) > 0) continue;
    const std::string text = parameter->description + " (" + expectation<Config>(parameter->name) +
                             "; default " + toText(defaults.at(parameter->name)) + ")";
    description.add_options()(parameter->name.c_str(), po::value<std::string>()->value_name("VALUE"),
                              text.c_str());
  }
}

}  // namespace

void StageParameters::setMode(const std::string& mode) {
  requireArgument(mode == "paper" || mode == "fast" || mode == "quality", "mode", mode,
                  "paper, fast or quality");
  plane_refinement_.refinement_mode =
      static_cast<int>(mode == "quality" ? RefinementMode::QUALITY : RefinementMode::PAPER);
  disparity_.full_width = mode != "paper";
  disparity_.aggregate_rows = mode == "quality";
  if (mode == "fast") disparity_.stereo_algorithm = static_cast<int>(StereoAlgorithm::CENSUS_SGM);
}

void StageParameters::set(const std::string& name, const std::string& value) {
  YAML::Node node;
  try {
    node = YAML::Load(value);
  } catch (const YAML::Exception&) {
    // Left empty, which is refused below like everything else that is no number.
  }
  if (!node.IsScalar()) node = value;
  if (!setIfKnown(disparity_, name, node) && !setIfKnown(segmentation_, name, node) &&
      !setIfKnown(plane_refinement_, name, node)) {
    throw std::invalid_argument(name + " is no parameter of disparity, segmentation or plane_refinement");
  }
}

std::vector<std::string> StageParameters::load(const std::string& file) {
  std::vector<std::string> unknown;
  try {
    const YAML::Node root = YAML::LoadFile(file);
    if (!root.IsMap() && !root.IsNull()) throw std::invalid_argument("no map of nodelets");
    for (const auto& entry : root) {
      const auto nodelet = entry.first.as<std::string>();
      if (nodelet == "disparity") {
        loadSection(entry.second, nodelet, disparity_, unknown);
      } else if (nodelet == "segmentation") {
        loadSection(entry.second, nodelet, segmentation_, unknown);
      } else if (nodelet == "plane_refinement") {
        loadSection(entry.second, nodelet, plane_refinement_, unknown);
      } else {
        unknown.push_back(nodelet);
      }
    }
  } catch (const std::exception& error) {
    throw std::runtime_error(file + ": " + error.what());
  }
  return unknown;
}

MatchingParameters StageParameters::matching() const { return checkedParameters(disparity_); }

SegmentationParameters StageParameters::segmentation() const { return checkedParameters(segmentation_); }

RefinementParameters StageParameters::refinement() const { return checkedParameters(plane_refinement_); }

std::map<std::string, StageParameters::Value> StageParameters::values() const {
  std::map<std::string, Value> values = toValues(disparity_);
  values.merge(toValues(segmentation_));
  values.merge(toValues(plane_refinement_));
  return values;
}

std::map<std::string, StageParameters::Value> StageParameters::matchingValues() const {
  return toValues(disparity_);
}

bool StageParameters::hasSameMatching(const StageParameters& other) const {
  return toValues(disparity_) == toValues(other.disparity_);
}

bool StageParameters::hasSameSegmentation(const StageParameters& other) const {
  return toValues(segmentation_) == toValues(other.segmentation_);
}

void StageParameters::addOptions(po::options_description& description) {
  addFileOption(description);
  description.add_options()("mode", po::value<std::string>()->value_name("MODE"),
                            "paper (default); fast: the census matcher, full_width; quality: the refinement "
                            "beyond the paper, full_width, aggregate_rows. File and options win over it");
  addConfigOptions<DisparityConfig>(description);
  addConfigOptions<SegmentationConfig>(description);
  addConfigOptions<PlaneRefinementConfig>(description);
}

void StageParameters::addSegmentationOptions(po::options_description& description) {
  addFileOption(description);
  addConfigOptions<SegmentationConfig>(description, {"lambda", "h"});
}

void StageParameters::readOptions(const po::variables_map& options) {
  if (options.count("mode") > 0) setMode(options["mode"].as<std::string>());
  if (options.count("params") > 0) {
    const auto file = options["params"].as<std::string>();
    for (const std::string& name : load(file)) {
      std::fprintf(stderr, "%s: %s has no meaning here\n", file.c_str(), name.c_str());
    }
  }
  for (const auto& [name, value] : values()) {
    if (options.count(name) > 0) set(name, options[name].as<std::string>());
  }
}

std::string matcherName(const MatchingParameters& parameters) {
  if (parameters.stereo_algorithm == StereoAlgorithm::BM) return "BM";
  if (parameters.stereo_algorithm == StereoAlgorithm::CENSUS_SGM) return "census SGM";
  switch (parameters.sgbm_mode) {
    case SgbmMode::SGBM:
      return "SGBM";
    case SgbmMode::HH:
      return "SGBM HH";
    case SgbmMode::SGBM_3WAY:
      return "SGBM 3WAY";
    case SgbmMode::HH4:
      return "SGBM HH4";
  }
  return "SGBM";
}

}  // namespace disparity_refinement
