#include <gtest/gtest.h>

#include <limits>

#include "disparity_refinement/ros/LiveParameters.hpp"

namespace disparity_refinement {
namespace {

template <class Config>
auto defaultParameters() {
  Config config = Config::__getDefault__();
  return toParameters(config);
}

TEST(LiveParameters, matchingDefaultsAreThoseOfTheCore) {
  const MatchingParameters core;
  const MatchingParameters live = defaultParameters<DisparityConfig>();
  EXPECT_EQ(live.stereo_algorithm, core.stereo_algorithm);
  EXPECT_EQ(live.sgbm_mode, core.sgbm_mode);
  EXPECT_EQ(live.prefilter_size, core.prefilter_size);
  EXPECT_EQ(live.prefilter_cap, core.prefilter_cap);
  EXPECT_EQ(live.correlation_window_size, core.correlation_window_size);
  EXPECT_EQ(live.min_disparity, core.min_disparity);
  EXPECT_EQ(live.disparity_range, core.disparity_range);
  EXPECT_EQ(live.uniqueness_ratio, core.uniqueness_ratio);
  EXPECT_EQ(live.texture_threshold, core.texture_threshold);
  EXPECT_EQ(live.speckle_size, core.speckle_size);
  EXPECT_EQ(live.speckle_range, core.speckle_range);
  EXPECT_EQ(live.P1, core.P1);
  EXPECT_EQ(live.P2, core.P2);
  EXPECT_EQ(live.disp12MaxDiff, core.disp12MaxDiff);
  EXPECT_EQ(live.full_width, core.full_width);
  EXPECT_EQ(live.aggregate_rows, core.aggregate_rows);
}

TEST(LiveParameters, segmentationDefaultsAreThoseOfTheCore) {
  const SegmentationParameters core;
  const SegmentationParameters live = defaultParameters<SegmentationConfig>();
  EXPECT_EQ(live.lambda, core.lambda);
  EXPECT_EQ(live.h, core.h);
  EXPECT_EQ(live.connectivity, core.connectivity);
  EXPECT_EQ(live.gradient.structuring_element, core.gradient.structuring_element);
  EXPECT_EQ(live.gradient.shadow_enhancement, core.gradient.shadow_enhancement);
  EXPECT_EQ(live.gradient.shadow_threshold, core.gradient.shadow_threshold);
  EXPECT_EQ(live.gradient.shadow_gamma, core.gradient.shadow_gamma);
}

TEST(LiveParameters, refinementDefaultsAreThoseOfTheCore) {
  const PlaneRefinementParameters core;
  const RefinementParameters refinement = defaultParameters<PlaneRefinementConfig>();
  EXPECT_EQ(refinement.mode, RefinementParameters().mode);
  const PlaneRefinementParameters& live = refinement.planes;
  EXPECT_EQ(live.inlier_threshold, core.inlier_threshold);
  EXPECT_EQ(live.confidence, core.confidence);
  EXPECT_EQ(live.max_slope_x, core.max_slope_x);
  EXPECT_EQ(live.max_slope_y, core.max_slope_y);
  EXPECT_EQ(live.disparity_error, core.disparity_error);
  EXPECT_EQ(live.max_depth_error, core.max_depth_error);
  EXPECT_EQ(live.min_valid_fraction, core.min_valid_fraction);
  EXPECT_EQ(live.min_valid_points, core.min_valid_points);
  EXPECT_EQ(live.max_iterations, core.max_iterations);
  EXPECT_EQ(live.max_divergence, core.max_divergence);
  EXPECT_EQ(live.divergence_action, core.divergence_action);
  EXPECT_EQ(live.out_of_range_action, core.out_of_range_action);
}

TEST(LiveParameters, everyCornerOfTheConfigurationIsValid) {
  for (DisparityConfig config : {DisparityConfig::__getMin__(), DisparityConfig::__getMax__()}) {
    for (int algorithm : {0, 1, 2}) {
      config.stereo_algorithm = algorithm;
      config.P1 = config.P2 = 0;  // P1 < P2 is the one condition that no single value can be blamed for
      EXPECT_NO_THROW(validate(toParameters(config)));
    }
  }
  for (SegmentationConfig config : {SegmentationConfig::__getMin__(), SegmentationConfig::__getMax__()}) {
    EXPECT_NO_THROW(validate(toParameters(config)));
  }
  for (PlaneRefinementConfig config :
       {PlaneRefinementConfig::__getMin__(), PlaneRefinementConfig::__getMax__()}) {
    EXPECT_NO_THROW(validate(toParameters(config)));
  }
}

TEST(LiveParameters, valuesBetweenTheAllowedOnesAreReplaced) {
  DisparityConfig disparity = DisparityConfig::__getDefault__();
  disparity.correlation_window_size = 6;
  disparity.disparity_range = 100;
  EXPECT_EQ(toParameters(disparity).correlation_window_size, 7);
  EXPECT_EQ(toParameters(disparity).disparity_range, 96);
  EXPECT_EQ(disparity.correlation_window_size, 7) << "the user sees what is in force";
  EXPECT_EQ(disparity.disparity_range, 96);
  disparity.correlation_window_size = 21;
  EXPECT_EQ(toParameters(disparity).correlation_window_size, 15);
  disparity.correlation_window_size = 1;
  disparity.stereo_algorithm = 0;
  EXPECT_EQ(toParameters(disparity).correlation_window_size, 5);

  disparity.P1 = 200;
  disparity.P2 = 800;
  EXPECT_EQ(toParameters(disparity).P2, 800);
  disparity.stereo_algorithm = 2;
  EXPECT_EQ(toParameters(disparity).P2, 224) << "the largest one of CENSUS_SGM";
  EXPECT_EQ(disparity.P2, 224);
  EXPECT_EQ(disparity.P1, 200);
  EXPECT_NO_THROW(validate(toParameters(disparity)));

  SegmentationConfig segmentation = SegmentationConfig::__getDefault__();
  segmentation.connectivity = 6;
  EXPECT_EQ(toParameters(segmentation).connectivity, Connectivity::EIGHT);
  EXPECT_EQ(segmentation.connectivity, 8);
}

TEST(LiveParameters, algorithmsHaveTheNumbersOfTheCore) {
  DisparityConfig config = DisparityConfig::__getDefault__();
  config.stereo_algorithm = Disparity_BM;
  EXPECT_EQ(toParameters(config).stereo_algorithm, StereoAlgorithm::BM);
  config.stereo_algorithm = Disparity_SGBM;
  EXPECT_EQ(toParameters(config).stereo_algorithm, StereoAlgorithm::SGBM);
  config.stereo_algorithm = Disparity_CENSUS_SGM;
  EXPECT_EQ(toParameters(config).stereo_algorithm, StereoAlgorithm::CENSUS_SGM);
}

TEST(LiveParameters, fullDpMeansEightDirections) {
  DisparityConfig config = DisparityConfig::__getDefault__();
  config.fullDP = true;
  EXPECT_EQ(toParameters(config).sgbm_mode, SgbmMode::HH);
}

TEST(LiveParameters, notANumberBecomesTheDefault) {
  PlaneRefinementConfig config = PlaneRefinementConfig::__getDefault__();
  config.inlier_threshold = std::numeric_limits<double>::quiet_NaN();
  config.max_divergence = 7.0;
  config.__clamp__();
  replaceNan(config);
  EXPECT_EQ(config.inlier_threshold, PlaneRefinementParameters().inlier_threshold);
  EXPECT_EQ(config.max_divergence, 7.0);
}

}  // namespace
}  // namespace disparity_refinement
