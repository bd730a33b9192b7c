// OpenCV's matchers, the yardsticks: all search the same disparities.

#include <map>
#include <memory>
#include <opencv2/calib3d.hpp>

#include "benchmarks.hpp"
#include "disparity_refinement/matching/StereoMatcher.hpp"

#ifdef HAVE_XIMGPROC
#include <opencv2/ximgproc/disparity_filter.hpp>
#endif

namespace disparity_refinement {
namespace {

cv::Ptr<cv::StereoSGBM> semiGlobal(int mode) {
  constexpr int WINDOW = 5, AREA = WINDOW * WINDOW;
  return cv::StereoSGBM::create(0, DISPARITIES, WINDOW, 8 * AREA, 32 * AREA, 1, 63, 10, 100, 2, mode);
}

// On a large frame a matcher runs for seconds, and what it allocates is nothing beside that.
template <class Make>
void registerMatcher(const std::string& set, const std::string& name, const Make& create) {
  const auto make = [create](const Frame& frame) {
    return [&frame, matcher = create(), disparity = cv::Mat()]() mutable {
      matcher->compute(frame.left, frame.right, disparity);
    };
  };
  registerBenchmark(set, name, 1, make, WarmUp::NO);
}

#ifdef HAVE_XIMGPROC
// The disparity of the right image that the filter wants, computed once for every frame.
const cv::Mat& rightDisparity(const Frame& frame, const cv::Ptr<cv::StereoSGBM>& matcher) {
  static std::map<const Frame*, cv::Mat> maps;
  cv::Mat& map = maps[&frame];
  if (map.empty()) cv::ximgproc::createRightMatcher(matcher)->compute(frame.right, frame.left, map);
  return map;
}
#endif

}  // namespace

void registerMatchingBenchmarks(const std::string& set) {
  registerMatcher(set, "cv::StereoSGBM, MODE_SGBM", [] { return semiGlobal(cv::StereoSGBM::MODE_SGBM); });
  registerMatcher(set, "cv::StereoSGBM, MODE_SGBM_3WAY",
                  [] { return semiGlobal(cv::StereoSGBM::MODE_SGBM_3WAY); });
  registerMatcher(set, "cv::StereoBM, window 15", [] { return cv::StereoBM::create(DISPARITIES, 15); });
#ifdef HAVE_XIMGPROC
  // The filter alone: the second matching that it asks for is not in its time.
  registerBenchmark(set, "cv::ximgproc WLS filter", 1, [](const Frame& frame) {
    const cv::Ptr<cv::StereoSGBM> matcher = semiGlobal(cv::StereoSGBM::MODE_SGBM_3WAY);
    cv::Mat left;
    frame.disparity.convertTo(left, CV_16S, cv::StereoMatcher::DISP_SCALE);
    return [&frame, left, right = rightDisparity(frame, matcher),
            filter = cv::ximgproc::createDisparityWLSFilter(matcher),
            filtered = cv::Mat()]() mutable { filter->filter(left, frame.left, filtered, right); };
  });
#endif
  MatchingParameters parameters;
  parameters.disparity_range = DISPARITIES;
  registerMatcher(set, "StereoMatcher, default (3WAY)",
                  [parameters] { return std::make_unique<StereoMatcher>(parameters); });
}

}  // namespace disparity_refinement
