// StereoMatcher: all algorithms, any parameters, images and principal points.

#include "Input.hpp"
#include "disparity_refinement/matching/StereoMatcher.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

MatchingParameters parametersOf(Input& input) {
  MatchingParameters parameters;
  parameters.stereo_algorithm = input.enumeration<StereoAlgorithm>(0, 2);
  parameters.sgbm_mode = input.enumeration<SgbmMode>(0, 3);
  const bool is_bm = parameters.stereo_algorithm == StereoAlgorithm::BM;
  parameters.prefilter_size = 2 * input.number(2, 127) + 1;
  parameters.prefilter_cap = input.parameter(1, 63);
  parameters.correlation_window_size = 2 * (is_bm ? input.number(2, 10) : input.number(0, 7)) + 1;
  parameters.min_disparity = input.oneIn(8) ? input.parameter(-2048, 2048) : input.parameter(-30, 30);
  parameters.disparity_range = 16 * input.number(1, 4);
  if (input.isWild()) {
    if (input.oneIn(8)) parameters.prefilter_size = input.parameter(5, 255);
    if (input.oneIn(8)) parameters.correlation_window_size = input.parameter(1, 255);
    if (input.oneIn(8)) parameters.disparity_range = input.parameter(16, 64);
  }
  parameters.uniqueness_ratio = input.parameter(0, 99);
  parameters.texture_threshold = input.parameter(0, 10000);
  parameters.speckle_size = input.parameter(0, 1000);
  parameters.speckle_range = input.oneIn(4) ? input.parameter(0, 4096) : input.parameter(0, 8);
  if (input.yes()) parameters.P1 = input.parameter(0, 1000);
  if (input.yes()) parameters.P2 = input.parameter(0, 16383);
  if (parameters.stereo_algorithm == StereoAlgorithm::CENSUS_SGM && input.yes()) {
    parameters.P1 = input.parameter(0, 223);
    parameters.P2 = input.parameter(0, 224);
  }
  parameters.disp12MaxDiff = input.oneIn(4) ? input.parameter(-1, 4096) : input.parameter(-1, 4);
  parameters.full_width = input.yes();
  parameters.aggregate_rows = input.yes();
  return parameters;
}

void requireMap(const cv::Mat& map, const DisparityRange& range) {
  bool has_hole = false;
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      const float d = map.at<float>(y, x);
      const bool is_valid = range.isValid(d);
      require(is_valid ? d <= range.max : d == range.invalid(),
              "every pixel is in range or has the invalid value");
      has_hole = has_hole || !is_valid;
    }
  }
  require(has_hole, "at least one pixel is invalid");
}

}  // namespace

void test(Input& input) {
  StereoMatcher matcher;
  for (int i = input.number(0, 1); i >= 0; --i) {
    const MatchingParameters parameters = parametersOf(input);
    if (!succeeds([&] { matcher.setParameters(parameters); })) continue;
    // Beside the columns that have no candidates in the right image.
    const cv::Size size = input.size(60 + parameters.disparity_range, 40);
    const Picture left = input.gray(size), right = input.gray(size);
    const double offset = input.oneIn(2) ? 0.0 : input.parameter(-50.0, 50.0);
    Picture map = input.picture(size, CV_32FC1);
    const auto match = [&](StereoMatcher& object, cv::Mat& result) {
      return succeeds([&] { object.compute(left.mat(), right.mat(), result, offset); });
    };
    if (!match(matcher, map.mat())) continue;
    requireMap(map.mat(), matcher.range(offset));
    const cv::Rect window = matcher.validWindow(size);
    require((window & cv::Rect({0, 0}, size)) == window, "the valid window is inside of the image");
    if (!input.oneIn(4)) continue;
    const Threads threads(2);
    StereoMatcher other(parameters);
    cv::Mat again;
    require(match(other, again) && same(again, map.mat()),
            "another object and two threads give the same bits");
  }
}

}  // namespace fuzz
}  // namespace disparity_refinement
