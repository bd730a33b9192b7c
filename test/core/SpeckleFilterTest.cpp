#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <stdexcept>

#include "disparity_refinement/matching/SpeckleFilter.hpp"

namespace disparity_refinement {
namespace {

constexpr short INVALID = -16;

cv::Mat mapOf(const cv::Size& size, const std::function<int(int x, int y)>& value) {
  cv::Mat map(size, CV_16SC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) map.at<short>(y, x) = static_cast<short>(value(x, y));
  }
  return map;
}

/// One filter, which keeps its buffers from one map to the next.
class Filter {
 public:
  void expectThatOfOpenCv(const cv::Mat& map, int max_size, int max_difference) {
    cv::Mat expected = map.clone(), filtered = map.clone(), buffer;
    cv::filterSpeckles(expected, INVALID, max_size, max_difference, buffer);
    filter_.apply(filtered, INVALID, max_size, max_difference);
    EXPECT_EQ(cv::norm(filtered, expected, cv::NORM_INF), 0.0)
        << map.size() << ", regions of " << max_size << ", differences of " << max_difference;
    removed_ += cv::countNonZero(expected != map);
    kept_ += cv::countNonZero(expected != INVALID);
  }

  void expectThatOfOpenCv(const cv::Mat& map) {
    for (const int max_size : {0, 1, 2, 10, 100, 1000000}) {
      for (const int max_difference : {0, 1, 3, 32}) expectThatOfOpenCv(map, max_size, max_difference);
    }
  }

  int removed() const { return removed_; }
  int kept() const { return kept_; }

 private:
  SpeckleFilter filter_;
  int removed_ = 0, kept_ = 0;
};

TEST(SpeckleFilter, equalsThatOfOpenCvForRandomMaps) {
  cv::RNG rng(1);
  Filter filter;
  for (const int levels : {2, 4, 12, 2048}) {
    for (const int invalid_percent : {0, 10, 50, 90, 100}) {
      for (const cv::Size& size : {cv::Size(1, 1), cv::Size(1, 30), cv::Size(30, 1), cv::Size(2, 2),
                                   cv::Size(17, 40), cv::Size(120, 90)}) {
        filter.expectThatOfOpenCv(mapOf(size, [&](int, int) {
          return rng.uniform(0, 100) < invalid_percent ? int{INVALID} : rng.uniform(0, levels);
        }));
      }
    }
  }
  EXPECT_GT(filter.removed(), 100000);
  EXPECT_GT(filter.kept(), 100000);
}

TEST(SpeckleFilter, equalsThatOfOpenCvForRegionsOfManyShapes) {
  const cv::Size size(130, 110);
  Filter filter;
  const auto expect = [&](const std::function<int(int x, int y)>& value) {
    filter.expectThatOfOpenCv(mapOf(size, value));
  };
  // Ramps, of which neighbours differ by as much as is allowed, or by more.
  for (const int slope : {1, 2, 3, 4, 32, 33}) {
    expect([=](int x, int) { return slope * x; });
    expect([=](int, int y) { return slope * y; });
    expect([=](int x, int y) { return slope * (x + y) - 2000; });
  }
  // Columns that meet in the last row, and in the first one; steps of a row that are none of a column.
  expect([&](int x, int y) { return x % 2 == 0 || y == size.height - 1 ? 5 : int{INVALID}; });
  expect([&](int x, int y) { return x % 2 == 0 || y == 0 ? 5 : int{INVALID}; });
  expect([&](int x, int y) { return x % 2 == 0 || y == size.height - 1 ? 5 : 500; });
  expect([](int x, int y) { return y % 2 == 0 ? 0 : x; });
  expect([](int x, int y) { return y % 7 == 6 ? 10 * (x / 13) : 10 * (x / 10); });
  // Squares, which touch by their corners alone; rings; a spiral.
  expect([](int x, int y) { return (x / 3 + y / 3) % 2 == 0 ? 7 : int{INVALID}; });
  expect(
      [](int x, int y) { return std::max(std::abs(x - 65), std::abs(y - 55)) % 3 == 0 ? 7 : int{INVALID}; });
  expect([](int x, int y) {
    const double radius = std::hypot(x - 65, y - 55), angle = std::atan2(y - 55, x - 65);
    return std::sin(radius / 2 - angle) > 0 ? 7 : int{INVALID};
  });
  EXPECT_GT(filter.removed(), 10000);
  EXPECT_GT(filter.kept(), 10000);
}

TEST(SpeckleFilter, takesTheWholeRangeOfValues) {
  cv::RNG rng(2);
  cv::Mat map(60, 70, CV_16SC1);
  rng.fill(map, cv::RNG::UNIFORM, std::numeric_limits<short>::min(), std::numeric_limits<short>::max() + 1);
  Filter filter;
  for (const int max_difference : {100, 20000, 40000, 65535}) {
    filter.expectThatOfOpenCv(map, 5, max_difference);
    filter.expectThatOfOpenCv(map, 100, max_difference);
  }
}

TEST(SpeckleFilter, changesItsPartOfALargerMapAlone) {
  cv::RNG rng(3);
  const cv::Mat whole = mapOf({90, 50}, [&](int, int) { return rng.uniform(0, 4); });
  const cv::Rect part(7, 5, 60, 31);
  cv::Mat expected = whole.clone(), filtered = whole.clone(), buffer;
  cv::Mat expected_part = expected(part).clone(), filtered_part = filtered(part);
  cv::filterSpeckles(expected_part, INVALID, 30, 1, buffer);
  expected_part.copyTo(expected(part));
  SpeckleFilter().apply(filtered_part, INVALID, 30, 1);
  EXPECT_EQ(cv::norm(filtered, expected, cv::NORM_INF), 0.0);
}

TEST(SpeckleFilter, refusesMapsOfAnotherType) {
  cv::Mat empty, bytes(3, 4, CV_8UC1);
  EXPECT_THROW(SpeckleFilter().apply(empty, INVALID, 10, 1), std::invalid_argument);
  EXPECT_THROW(SpeckleFilter().apply(bytes, INVALID, 10, 1), std::invalid_argument);
}

}  // namespace
}  // namespace disparity_refinement
