// OpenCV's matchers, the yardsticks, and ours: all search the same disparities.

#include <map>
#include <memory>
#include <opencv2/calib3d.hpp>

#include "benchmarks.hpp"
#include "disparity_refinement/matching/SpeckleFilter.hpp"
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

template <class Make>
void registerMatcher(const std::string& set, const std::string& name, int threads, WarmUp warm_up,
                     const Make& create) {
  const auto make = [create](const Frame& frame) {
    return [&frame, matcher = create(), disparity = cv::Mat()]() mutable {
      matcher->compute(frame.left, frame.right, disparity);
    };
  };
  registerBenchmark(set, name, threads, make, warm_up);
}

// On a large frame OpenCV's matchers run for seconds, and what they allocate is nothing beside that.
template <class Make>
void registerMatcher(const std::string& set, const std::string& name, const Make& create) {
  registerMatcher(set, name, 1, WarmUp::NO, create);
}

MatchingParameters censusParameters(bool aggregate_rows = false) {
  MatchingParameters parameters;
  parameters.stereo_algorithm = StereoAlgorithm::CENSUS_SGM;
  parameters.disparity_range = DISPARITIES;
  parameters.full_width = true;
  parameters.uniqueness_ratio = 0;
  parameters.aggregate_rows = aggregate_rows;
  return parameters;
}

// What StereoMatcher does with the census matcher, but on one thread with the vectors that every processor
// has.
class MatcherOf16ByteVectors {
 public:
  void compute(const cv::Mat& left, const cv::Mat& right, cv::Mat& disparity) {
    const MatchingParameters common = censusParameters();
    CensusSgmParameters parameters;
    parameters.disparity_range = common.disparity_range;
    parameters.uniqueness_ratio = common.uniqueness_ratio;
    parameters.disp12_max_diff = common.disp12MaxDiff;
    matcher_.compute(left, right, parameters, fixed_point_);
    speckle_filter_.apply(fixed_point_, CensusSgm::INVALID, common.speckle_size,
                          common.speckle_range * CensusSgm::SUBPIXEL_STEPS);
    fixed_point_.convertTo(disparity, CV_32F, 1.0 / CensusSgm::SUBPIXEL_STEPS);
  }

 private:
  CensusSgm matcher_{CensusSgm::Vectors::BYTES_16};
  SpeckleFilter speckle_filter_;
  cv::Mat fixed_point_;
};

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
  for (const bool aggregate_rows : {false, true}) {
    const std::string name = aggregate_rows ? "census SGM, aggregate_rows" : "census SGM";
    const auto census = [=] { return std::make_unique<StereoMatcher>(censusParameters(aggregate_rows)); };
    registerMatcher(set, name, 1, WarmUp::YES, census);
    registerMatcher(set, name + ", 2 threads", 2, WarmUp::YES, census);
  }
  registerMatcher(set, "census SGM, 16-byte vectors", 1, WarmUp::YES,
                  [] { return std::make_unique<MatcherOf16ByteVectors>(); });
}

}  // namespace disparity_refinement
