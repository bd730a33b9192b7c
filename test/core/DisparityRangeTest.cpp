#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "disparity_refinement/DisparityRange.hpp"

namespace disparity_refinement {
namespace {

TEST(DisparityRange, invalidIsOneBelowTheMinimum) {
  DisparityRange range;
  range.min = -3.5F;
  EXPECT_EQ(range.invalid(), -4.5F);
}

TEST(DisparityRange, onlyTheMinimumAndAboveAreValid) {
  DisparityRange range;
  range.min = 2.0F;
  EXPECT_TRUE(range.isValid(2.0F));
  EXPECT_TRUE(range.isValid(1000.0F));
  EXPECT_FALSE(range.isValid(range.invalid()));
  EXPECT_FALSE(range.isValid(1.99F));
  EXPECT_FALSE(range.isValid(-std::numeric_limits<float>::infinity()));
  EXPECT_FALSE(range.isValid(std::numeric_limits<float>::quiet_NaN()));
}

TEST(DisparityRange, hasRoomForTheInvalidValue) {
  const float coarse = 16777216.0F, not_a_number = std::numeric_limits<float>::quiet_NaN(),
              infinite = std::numeric_limits<float>::infinity();
  ASSERT_EQ(-coarse - 1.0F, -coarse);
  EXPECT_NO_THROW(validate({-coarse + 1.0F, coarse}));
  EXPECT_NO_THROW(validate({coarse, coarse}));
  EXPECT_NO_THROW(validate({5.0F, 5.0F}));
  for (const float min : {-coarse, coarse + 4.0F, -1e30F, 1e30F, not_a_number, infinite, -infinite}) {
    EXPECT_THROW(validate({min, 2e30F}), std::invalid_argument) << min;
  }
  for (const float max : {4.0F, not_a_number, infinite, -infinite}) {
    EXPECT_THROW(validate({5.0F, max}), std::invalid_argument) << max;
  }
}

TEST(KeepOneInvalid, invalidatesTheTopLeftPixelOfAFullMapOnly) {
  const DisparityRange range;
  cv::Mat map = (cv::Mat_<float>(2, 3) << 5, 6, 7, 8, 9, 0);
  const cv::Mat expected = (cv::Mat_<float>(2, 3) << -1, 6, 7, 8, 9, 0);
  keepOneInvalid(map, range);
  EXPECT_EQ(cv::norm(map, expected, cv::NORM_INF), 0.0);
}

TEST(KeepOneInvalid, leavesAMapWithAHoleAlone) {
  const DisparityRange range;
  cv::Mat map = (cv::Mat_<float>(2, 3) << 5, 6, 7, 8, 9, -1);
  const cv::Mat expected = map.clone();
  keepOneInvalid(map, range);
  EXPECT_EQ(cv::norm(map, expected, cv::NORM_INF), 0.0);
}

TEST(KeepOneInvalid, acceptsAnEmptyMap) {
  cv::Mat map;
  keepOneInvalid(map, DisparityRange());
  EXPECT_TRUE(map.empty());
}

}  // namespace
}  // namespace disparity_refinement
