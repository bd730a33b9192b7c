#include <gtest/gtest.h>

#include <stdexcept>

#include "disparity_refinement/refinement/RefinementStatistics.hpp"

namespace disparity_refinement {
namespace {

const DisparityRange RANGE{0.0F, 64.0F};
const float HOLE = -1.0F;

SegmentPlane plane(PlaneStatus status, int pixels, double c = 0.0) {
  SegmentPlane result;
  result.status = status;
  result.pixels = pixels;
  result.c = c;
  return result;
}

/// One row of ten pixels for each of six segments; the seventh has no pixel.
class Statistics : public testing::Test {
 protected:
  Statistics() : labels_(6, 10, CV_32SC1), disparity_(6, 10, CV_32FC1, cv::Scalar(20.0F)) {
    for (int label = 0; label < labels_.rows; ++label) labels_.row(label) = label;
    // A plane at 1 px, where the depth error is too large: f * T / 16 / 2 m > 1.
    planes_ = {plane(PlaneStatus::ACCEPTED, 10, 20.0), plane(PlaneStatus::ACCEPTED, 10, 1.0),
               plane(PlaneStatus::ACCEPTED, 10, 30.0), plane(PlaneStatus::TOO_FEW_POINTS, 10),
               plane(PlaneStatus::DEGENERATE, 10),     plane(PlaneStatus::MAX_ITERATIONS, 10),
               plane(PlaneStatus::TOO_FEW_POINTS, 0)};
    disparity_.row(0).colRange(0, 6).setTo(HOLE);
    refined_ = disparity_.clone();
    refined_.row(0).setTo(20.0F);
  }

  RefinementStatistics measure() const {
    return measureRefinement(disparity_, refined_, labels_, RANGE, 400.0, parameters_, planes_);
  }

  cv::Mat labels_, disparity_, refined_;
  std::vector<SegmentPlane> planes_;
  RefinementParameters parameters_;
};

TEST_F(Statistics, countPixelsAndSegments) {
  const RefinementStatistics statistics = measure();
  EXPECT_DOUBLE_EQ(statistics.valid_before, 54.0 / 60.0);
  EXPECT_DOUBLE_EQ(statistics.valid_after, 1.0);
  EXPECT_EQ(statistics.segments, 6);
  EXPECT_EQ(statistics.refused_by_depth_error, 1);
  EXPECT_EQ(statistics.refused_by_divergence, 1);
  EXPECT_EQ(statistics.too_few_points, 1);
  EXPECT_EQ(statistics.degenerate, 1);
  EXPECT_EQ(statistics.max_iterations, 1);
}

TEST_F(Statistics, aSegmentIsRefusedWhenMostOfItsPixelsAre) {
  disparity_.row(2).colRange(0, 5).setTo(30.0F);
  EXPECT_EQ(measure().refused_by_divergence, 0) << "half of them are not most";
  disparity_.row(2).colRange(0, 4).setTo(30.0F);
  disparity_.row(2).col(4).setTo(20.0F);
  EXPECT_EQ(measure().refused_by_divergence, 1);
  disparity_.row(2).setTo(HOLE);
  EXPECT_EQ(measure().refused_by_divergence, 0) << "a hole diverges from nothing";
}

TEST_F(Statistics, followTheParameters) {
  parameters_.planes.disparity_error = 0.0;
  EXPECT_EQ(measure().refused_by_depth_error, 0);
  EXPECT_EQ(measure().refused_by_divergence, 2) << "what condition 1 lets through meets condition 4";
  parameters_.planes.divergence_action = DivergenceAction::TAKE_PLANE;
  EXPECT_EQ(measure().refused_by_divergence, 0);
  planes_[1].c = 70.0;
  EXPECT_EQ(measure().refused_by_depth_error, 1) << "outside the range";
  parameters_.planes.out_of_range_action = OutOfRangeAction::CLAMP;
  EXPECT_EQ(measure().refused_by_depth_error, 0);
}

TEST_F(Statistics, conditionsPerPixelHaveNoPartInModeQuality) {
  parameters_.mode = RefinementMode::QUALITY;
  EXPECT_EQ(measure().refused_by_depth_error, 0);
  EXPECT_EQ(measure().refused_by_divergence, 0);
  EXPECT_EQ(measure().max_iterations, 1);
}

// Condition 1 asks for d >= sqrt(f * T / 32): 20 px for f * T = 12800 px m.
TEST(RefinementStatistics, agreeWithTheRefinement) {
  cv::Mat disparity(20, 20, CV_32FC1, cv::Scalar(20.0F)), refined;
  disparity.at<float>(5, 5) = HOLE;
  const cv::Mat labels(disparity.size(), CV_32SC1, cv::Scalar(0));
  const RefinementParameters parameters;
  DisparityRefinement refinement;
  for (const bool is_refused : {false, true}) {
    const double f_times_t = is_refused ? 13000.0 : 12000.0;
    refinement.refine(disparity, labels, {}, RANGE, f_times_t, parameters, refined);
    EXPECT_EQ(RANGE.isValid(refined.at<float>(5, 5)), !is_refused);
    const RefinementStatistics statistics = measureRefinement(disparity, refined, labels, RANGE, f_times_t,
                                                              parameters, refinement.fittedPlanes());
    EXPECT_EQ(statistics.refused_by_depth_error, is_refused ? 1 : 0);
    EXPECT_EQ(statistics.refused_by_divergence, 0);
  }
}

TEST_F(Statistics, refuseALabelWithoutAPlane) {
  labels_.at<int>(0, 0) = 7;
  EXPECT_THROW(measure(), std::invalid_argument);
  labels_ = labels_.colRange(0, 9).clone();
  EXPECT_THROW(measure(), std::invalid_argument);
}

}  // namespace
}  // namespace disparity_refinement
