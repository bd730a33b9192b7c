#include <gtest/gtest.h>

#include <stdexcept>

#include "disparity_refinement/refinement/DisparityRefinement.hpp"

namespace disparity_refinement {
namespace {

const DisparityRange RANGE{0.0F, 64.0F};
constexpr double F_TIMES_T = 400.0;

// A slanted plane with a hole; the right half is a segment without any disparity.
struct Scene {
  Scene() : disparity(40, 60, CV_32FC1), labels(40, 60, CV_32SC1), gray(40, 60, CV_8UC1, cv::Scalar(100)) {
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 60; ++x) {
        const bool is_right = x >= 30, is_hole = is_right || (x >= 8 && x < 16 && y >= 8 && y < 16);
        labels.at<int>(y, x) = is_right ? 1 : 0;
        disparity.at<float>(y, x) = is_hole ? RANGE.invalid() : 10.0F + 0.25F * static_cast<float>(y);
      }
    }
  }

  cv::Mat disparity, labels, gray;
};

TEST(DisparityRefinement, isThatOfItsMode) {
  const Scene scene;
  RefinementParameters parameters;
  parameters.planes.min_valid_points = 20;
  parameters.quality.medians = 1;
  DisparityRefinement refinement;
  cv::Mat refined, expected;

  refinement.refine(scene.disparity, scene.labels, cv::Mat(), RANGE, F_TIMES_T, parameters, refined);
  PlaneRefinement paper;
  paper.refine(scene.disparity, scene.labels, RANGE, F_TIMES_T, parameters.planes, expected);
  EXPECT_EQ(cv::norm(refined, expected, cv::NORM_INF), 0.0);
  ASSERT_EQ(refinement.planes().size(), 2U);
  EXPECT_EQ(refinement.planes()[0].b, paper.planes()[0].b);
  EXPECT_EQ(refinement.planes()[1].status, PlaneStatus::TOO_FEW_POINTS);

  parameters.mode = RefinementMode::QUALITY;
  refinement.refine(scene.disparity, scene.labels, scene.gray, RANGE, F_TIMES_T, parameters, refined);
  QualityRefinement quality;
  quality.refine(scene.disparity, scene.labels, scene.gray, RANGE, parameters.planes, parameters.quality,
                 expected);
  EXPECT_EQ(cv::norm(refined, expected, cv::NORM_INF), 0.0);
  const std::vector<SegmentPlane> planes = refinement.planes();
  ASSERT_EQ(planes.size(), 2U);
  EXPECT_EQ(planes[0].status, PlaneStatus::ACCEPTED);
  EXPECT_EQ(planes[0].c, quality.planes()[0].c);
  EXPECT_EQ(planes[0].valid, 30 * 40 - 64);
  EXPECT_EQ(planes[1].status, PlaneStatus::OF_NEIGHBOUR);
  EXPECT_NEAR(planes[1].b, 0.25, 1e-3);
  EXPECT_EQ(planes[1].valid, 0);
  EXPECT_EQ(refinement.fittedPlanes()[1].status, PlaneStatus::TOO_FEW_POINTS);
}

TEST(DisparityRefinement, needsTheImageForQualityOnly) {
  const Scene scene;
  RefinementParameters parameters;
  DisparityRefinement refinement;
  cv::Mat refined;
  EXPECT_NO_THROW(
      refinement.refine(scene.disparity, scene.labels, cv::Mat(), RANGE, F_TIMES_T, parameters, refined));
  parameters.mode = RefinementMode::QUALITY;
  EXPECT_THROW(
      refinement.refine(scene.disparity, scene.labels, cv::Mat(), RANGE, F_TIMES_T, parameters, refined),
      std::invalid_argument);
}

TEST(DisparityRefinement, hasFurtherSegmentations) {
  for (int number = 0; number <= MAX_FURTHER_SEGMENTATIONS; ++number) {
    RefinementParameters parameters;
    parameters.quality.further = furtherSegmentations(number);
    EXPECT_EQ(parameters.quality.further.size(), static_cast<std::size_t>(number));
    EXPECT_NO_THROW(validate(parameters));
  }
  EXPECT_EQ(furtherSegmentations(2)[1].lambda, 80);
  EXPECT_EQ(furtherSegmentations(2)[1].h, 15);
  EXPECT_THROW(furtherSegmentations(-1), std::invalid_argument);
  EXPECT_THROW(furtherSegmentations(MAX_FURTHER_SEGMENTATIONS + 1), std::invalid_argument);
}

TEST(DisparityRefinement, validatesBothSetsOfParameters) {
  RefinementParameters parameters;
  EXPECT_NO_THROW(validate(parameters));
  parameters.planes.inlier_threshold = 0.0;
  EXPECT_THROW(validate(parameters), std::invalid_argument);
  parameters = {};
  parameters.quality.medians = -1;
  EXPECT_THROW(validate(parameters), std::invalid_argument);
}

TEST(DisparityRefinement, refusesAnUnknownMode) {
  const Scene scene;
  RefinementParameters parameters;
  parameters.mode = static_cast<RefinementMode>(2);
  EXPECT_THROW(validate(parameters), std::invalid_argument);
  cv::Mat refined;
  EXPECT_THROW(DisparityRefinement().refine(scene.disparity, scene.labels, scene.gray, RANGE, F_TIMES_T,
                                            parameters, refined),
               std::invalid_argument);
  EXPECT_TRUE(refined.empty());
}

}  // namespace
}  // namespace disparity_refinement
