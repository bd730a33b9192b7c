#include <gtest/gtest.h>

#include <functional>
#include <opencv2/core.hpp>
#include <thread>
#include <vector>

#include "disparity_refinement/evaluation/SyntheticStreet.hpp"
#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/refinement/Confidence.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"
#include "disparity_refinement/strips.hpp"

// What several threads do in the core, with the same bits as one: for ThreadSanitizer, see parallel_for.cpp.

namespace disparity_refinement {
namespace {

constexpr int THREADS = 4;

class CoreThreads : public testing::Test {
 protected:
  CoreThreads() { cv::setNumThreads(THREADS); }
  ~CoreThreads() override { cv::setNumThreads(threads_before_); }

 private:
  const int threads_before_ = cv::getNumThreads();
};

const StreetFrame& street() {
  static const StreetFrame frame = [] {
    StreetParameters parameters;
    parameters.width = 160;
    parameters.height = 100;
    parameters.focal_length = 100;
    return SyntheticStreet(parameters).render(3);
  }();
  return frame;
}

MatchingParameters matchingParameters(StereoAlgorithm algorithm) {
  MatchingParameters parameters;
  parameters.stereo_algorithm = algorithm;
  parameters.disparity_range = 64;
  parameters.full_width = true;
  parameters.aggregate_rows = true;
  return parameters;
}

/// All results of a frame.
struct Results {
  std::vector<cv::Mat> images;
  std::vector<SegmentPlane> planes;
};

/// The whole chain, with `strips` of the segmentation.
Results computeFrame(StereoAlgorithm algorithm, RefinementMode mode, int strips) {
  const StreetFrame& frame = street();
  cv::Mat disparity, labels, refined, sources, confidence;
  StereoMatcher matcher(matchingParameters(algorithm));
  matcher.compute(frame.left, frame.right, disparity);
  Segmentation segmentation(strips);
  segmentation.compute(frame.left, {}, labels);
  RefinementParameters parameters;
  parameters.mode = mode;
  parameters.quality.further = furtherSegmentations(2);
  DisparityRefinement refinement;
  refinement.refine(disparity, labels, frame.left, matcher.range(), 50.0, parameters, refined);
  findSources(disparity, refined, labels, matcher.range(), refinement.fittedPlanes(), sources);
  findConfidence(sources, confidence);
  return {{disparity, labels, segmentation.filtered().clone(), refined, sources, confidence},
          refinement.planes()};
}

void expectSame(const Results& a, const Results& b) {
  ASSERT_EQ(a.images.size(), b.images.size());
  for (std::size_t i = 0; i < a.images.size(); ++i) {
    EXPECT_EQ(cv::norm(a.images[i], b.images[i], cv::NORM_INF), 0.0) << "image " << i;
  }
  ASSERT_EQ(a.planes.size(), b.planes.size());
  for (std::size_t i = 0; i < a.planes.size(); ++i) {
    EXPECT_EQ(a.planes[i].c, b.planes[i].c) << "plane " << i;
    EXPECT_EQ(a.planes[i].status, b.planes[i].status) << "plane " << i;
  }
}

TEST_F(CoreThreads, computeAFrameLikeOne) {
  for (const StereoAlgorithm algorithm : {StereoAlgorithm::SGBM, StereoAlgorithm::CENSUS_SGM}) {
    for (const RefinementMode mode : {RefinementMode::PAPER, RefinementMode::QUALITY}) {
      cv::setNumThreads(1);
      const Results expected = computeFrame(algorithm, mode, 1);
      cv::setNumThreads(THREADS);
      expectSame(computeFrame(algorithm, mode, 7), expected);
    }
  }
}

TEST_F(CoreThreads, segmentInStripsLikeOne) {
  const cv::Mat& gray = street().left;
  for (const Connectivity connectivity : {Connectivity::FOUR, Connectivity::EIGHT}) {
    SegmentationParameters parameters;
    parameters.connectivity = connectivity;
    cv::Mat expected, labels;
    Segmentation one, several(THREADS);
    const int n = one.compute(gray, parameters, expected);
    EXPECT_EQ(several.compute(gray, parameters, labels), n);
    EXPECT_EQ(cv::norm(labels, expected, cv::NORM_INF), 0.0);
    EXPECT_EQ(cv::norm(several.countSurface(gray, parameters, 20, 10),
                       one.countSurface(gray, parameters, 20, 10), cv::NORM_INF),
              0.0);
  }
}

TEST_F(CoreThreads, renderAStreetLikeOne) {
  const StreetParameters& parameters = {64, 48};
  const StreetFrame several = SyntheticStreet(parameters).render(1);
  cv::setNumThreads(1);
  const StreetFrame one = SyntheticStreet(parameters).render(1);
  EXPECT_EQ(cv::norm(several.left, one.left, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(several.disparity, one.disparity, cv::NORM_INF), 0.0);
}

// As the nodelets of one manager are.
TEST_F(CoreThreads, haveAnObjectEach) {
  const Results expected = computeFrame(StereoAlgorithm::CENSUS_SGM, RefinementMode::QUALITY, 1);
  std::vector<Results> results(3);
  std::vector<std::thread> threads;
  for (Results& result : results) {
    threads.emplace_back(
        [&result] { result = computeFrame(StereoAlgorithm::CENSUS_SGM, RefinementMode::QUALITY, 2); });
  }
  for (std::thread& thread : threads) thread.join();
  for (const Results& result : results) expectSame(result, expected);
}

// Not for itself: ThreadSanitizer must report it, or it would not see a race in the core either.
TEST_F(CoreThreads, DISABLED_raceForNothing) {
  std::vector<int> written(1);
  forEachStrip(THREADS, [&written](int i) { written[0] += i; });
}

}  // namespace
}  // namespace disparity_refinement
