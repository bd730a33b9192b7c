#include "disparity_refinement/ros/LiveParameters.hpp"

#include <XmlRpcValue.h>

#include <algorithm>
#include <cstddef>
#include <limits>

namespace disparity_refinement {
namespace {

int nextOdd(int value) { return value | 1; }

/// The value as a number, or NaN if it is none.
double toNumber(XmlRpc::XmlRpcValue value) {
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean:
      return static_cast<bool>(value) ? 1.0 : 0.0;
    case XmlRpc::XmlRpcValue::TypeInt:
      return static_cast<int>(value);
    case XmlRpc::XmlRpcValue::TypeDouble:
      return static_cast<double>(value);
    default:
      return std::numeric_limits<double>::quiet_NaN();
  }
}

/// All three have the same parameters in the same order.
template <class Values>
void warnAboutRefused(const ros::NodeHandle& private_nh, const Values& in_force, const Values& least,
                      const Values& largest) {
  for (std::size_t i = 0; i < in_force.size(); ++i) {
    const auto& parameter = in_force[i];
    XmlRpc::XmlRpcValue asked;
    if (!private_nh.getParam(parameter.name, asked)) continue;
    const double value = static_cast<double>(parameter.value);
    if (toNumber(asked) == value) continue;
    ROS_WARN_STREAM(private_nh.resolveName(parameter.name)
                    << " is " << asked << ", expected a value in " << static_cast<double>(least[i].value)
                    << "..." << static_cast<double>(largest[i].value) << ": using " << value);
  }
}

}  // namespace

MatchingParameters toParameters(DisparityConfig& config) {
  config.prefilter_size = nextOdd(config.prefilter_size);
  config.correlation_window_size = nextOdd(config.correlation_window_size);
  const bool is_bm = config.stereo_algorithm == static_cast<int>(StereoAlgorithm::BM);
  config.correlation_window_size =
      std::clamp(config.correlation_window_size, is_bm ? 5 : 1, is_bm ? 255 : 15);
  config.disparity_range = config.disparity_range / 16 * 16;
  if (config.stereo_algorithm == static_cast<int>(StereoAlgorithm::CENSUS_SGM)) {
    config.P1 = std::min(config.P1, CensusSgmParameters::MAX_P2 - 1);
    config.P2 = std::min(config.P2, CensusSgmParameters::MAX_P2);
  }

  MatchingParameters parameters;
  parameters.stereo_algorithm = static_cast<StereoAlgorithm>(config.stereo_algorithm);
  parameters.sgbm_mode = config.fullDP ? SgbmMode::HH : static_cast<SgbmMode>(config.sgbm_mode);
  parameters.prefilter_size = config.prefilter_size;
  parameters.prefilter_cap = config.prefilter_cap;
  parameters.correlation_window_size = config.correlation_window_size;
  parameters.min_disparity = config.min_disparity;
  parameters.disparity_range = config.disparity_range;
  parameters.uniqueness_ratio = config.uniqueness_ratio;
  parameters.texture_threshold = config.texture_threshold;
  parameters.speckle_size = config.speckle_size;
  parameters.speckle_range = config.speckle_range;
  parameters.P1 = config.P1;
  parameters.P2 = config.P2;
  parameters.disp12MaxDiff = config.disp12MaxDiff;
  parameters.full_width = config.full_width;
  parameters.aggregate_rows = config.aggregate_rows;
  return parameters;
}

SegmentationParameters toParameters(SegmentationConfig& config) {
  if (config.connectivity != static_cast<int>(Connectivity::FOUR)) {
    config.connectivity = static_cast<int>(Connectivity::EIGHT);
  }
  SegmentationParameters parameters;
  parameters.lambda = config.lambda;
  parameters.h = config.h;
  parameters.connectivity = static_cast<Connectivity>(config.connectivity);
  parameters.gradient.structuring_element = static_cast<StructuringElement>(config.structuring_element);
  parameters.gradient.shadow_enhancement = config.shadow_enhancement;
  parameters.gradient.shadow_threshold = config.shadow_threshold;
  parameters.gradient.shadow_gamma = config.shadow_gamma;
  return parameters;
}

RefinementParameters toParameters(PlaneRefinementConfig& config) {
  RefinementParameters parameters;
  parameters.mode = static_cast<RefinementMode>(config.refinement_mode);
  parameters.quality.further = furtherSegmentations(config.further_segmentations);
  PlaneRefinementParameters& planes = parameters.planes;
  planes.inlier_threshold = config.inlier_threshold;
  planes.confidence = config.confidence;
  planes.max_slope_x = config.max_slope_x;
  planes.max_slope_y = config.max_slope_y;
  planes.disparity_error = config.disparity_error;
  planes.max_depth_error = config.max_depth_error;
  planes.min_valid_fraction = config.min_valid_fraction;
  planes.min_valid_points = config.min_valid_points;
  planes.max_iterations = config.max_iterations;
  planes.max_divergence = config.max_divergence;
  planes.divergence_action = static_cast<DivergenceAction>(config.divergence_action);
  planes.out_of_range_action = static_cast<OutOfRangeAction>(config.out_of_range_action);
  return parameters;
}

VisualizationConfig toParameters(VisualizationConfig& config) {
  if (config.color_max_disparity <= config.color_min_disparity) {
    config.color_max_disparity = config.color_min_disparity + 1.0;
  }
  return config;
}

void waitUntilGone(const std::string& service) {
  constexpr double PATIENCE = 2.0, PAUSE = 0.005;  // [s]
  const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(PATIENCE);
  while (ros::service::exists(service, false) && ros::SteadyTime::now() < end)
    ros::WallDuration(PAUSE).sleep();
}

void warnAboutRefusedValues(const ros::NodeHandle& private_nh, const dynamic_reconfigure::Config& in_force,
                            const dynamic_reconfigure::Config& least,
                            const dynamic_reconfigure::Config& largest) {
  warnAboutRefused(private_nh, in_force.bools, least.bools, largest.bools);
  warnAboutRefused(private_nh, in_force.ints, least.ints, largest.ints);
  warnAboutRefused(private_nh, in_force.doubles, least.doubles, largest.doubles);
}

}  // namespace disparity_refinement
