// The census matcher and its speckle filter: any sizes, contents, parameters and threads. What comes out is
// that of the plain loops, and of OpenCV's speckle filter.

#include <opencv2/calib3d.hpp>

#include "Input.hpp"
#include "disparity_refinement/matching/CensusSgm.hpp"
#include "disparity_refinement/matching/SpeckleFilter.hpp"
#include "straightforward/CensusSgm.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

CensusSgmParameters parametersOf(Input& input) {
  CensusSgmParameters parameters;
  parameters.min_disparity = input.oneIn(8) ? input.parameter(-2048, 2048) : input.parameter(-30, 30);
  parameters.disparity_range = input.oneIn(32) ? input.parameter(1, 2048) : input.parameter(1, 70);
  parameters.p2 = input.parameter(0, 224);
  parameters.p1 = input.parameter(0, std::max(parameters.p2, 0));
  parameters.uniqueness_ratio = input.parameter(0, 99);
  parameters.disp12_max_diff = input.parameter(-1, 100);
  parameters.aggregate_rows = input.yes();
  return parameters;
}

void requireSpeckleFilter(Input& input, const cv::Mat& map) {
  cv::Mat filtered = map.clone(), expected = map.clone();
  const int most = input.number(0, 200), difference = input.number(0, 2048);
  SpeckleFilter().apply(filtered, CensusSgm::INVALID, most, difference);
  cv::filterSpeckles(expected, CensusSgm::INVALID, most, difference);
  require(same(filtered, expected), "the speckle filter does what OpenCV's does");
}

}  // namespace

void test(Input& input) {
  CensusSgm matcher(input.yes() ? CensusSgm::Vectors::WIDEST : CensusSgm::Vectors::BYTES_16);
  for (int i = input.number(0, 1); i >= 0; --i) {
    const CensusSgmParameters parameters = parametersOf(input);
    const int threads = input.parameter(1, 5);
    const Threads of_opencv(input.oneIn(8) ? 2 : 1);
    const cv::Size size = parameters.disparity_range > 70 ? input.size(6, 30) : input.size(50, 30);
    const Picture left = input.gray(size), right = input.gray(size);
    Picture map = input.picture(size, CV_16SC1);
    if (!succeeds([&] { matcher.compute(left.mat(), right.mat(), parameters, map.mat(), threads); }))
      continue;
    require(same(map.mat(), straightforward::matchCensus(left.mat(), right.mat(), parameters)),
            "the map is that of the plain loops");
    requireSpeckleFilter(input, map.mat());
  }
  // Any values at all.
  Picture map = input.picture(input.size(20, 20), CV_16SC1);
  input.fillGray(map.mat());
  const int invalid = input.number(-32768, 32767), most = input.parameter(0, 1000),
            difference = input.parameter(0, 65535);
  succeeds([&] { SpeckleFilter().apply(map.mat(), static_cast<short>(invalid), most, difference); });
}

}  // namespace fuzz
}  // namespace disparity_refinement
