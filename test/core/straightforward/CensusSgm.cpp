#include "CensusSgm.hpp"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

namespace disparity_refinement {
namespace straightforward {
namespace {

constexpr int LARGEST_SUM = 255, OUTSIDE_COST = 10, LARGEST_SLOPE = 15;

/// The pixel, or for one outside the nearest one of the border.
int grayAt(const cv::Mat& gray, int x, int y) {
  return gray.at<std::uint8_t>(std::clamp(y, 0, gray.rows - 1), std::clamp(x, 0, gray.cols - 1));
}

/// A number for every disparity of every pixel.
class Volume {
 public:
  Volume(const cv::Size& size, int disparities)
      : width_(size.width),
        disparities_(disparities),
        numbers_(static_cast<std::size_t>(size.area()) * disparities, 0) {}

  int& at(int x, int y, int d) { return numbers_[(std::size_t(y) * width_ + x) * disparities_ + d]; }
  int at(int x, int y, int d) const { return const_cast<Volume*>(this)->at(x, y, d); }

  /// The smallest disparity of the least number of a pixel.
  int winner(int x, int y) const {
    int best = 0;
    for (int d = 1; d < disparities_; ++d) {
      if (at(x, y, d) < at(x, y, best)) best = d;
    }
    return best;
  }

 private:
  int width_, disparities_;
  std::vector<int> numbers_;
};

Volume costsOfPairs(const cv::Mat& left, const cv::Mat& right, const CensusSgmParameters& p) {
  const cv::Mat left_bits = censusBits(left), right_bits = censusBits(right);
  const cv::Mat left_slope = censusSlope(left), right_slope = censusSlope(right);
  Volume costs(left.size(), p.disparity_range);
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) {
      for (int d = 0; d < p.disparity_range; ++d) {
        const int right_x = x - p.min_disparity - d;
        if (right_x < 0 || right_x >= left.cols) {
          costs.at(x, y, d) = OUTSIDE_COST;
          continue;
        }
        const std::bitset<16> a = left_bits.at<std::uint16_t>(y, x),
                              b = right_bits.at<std::uint16_t>(y, right_x);
        const int slopes = left_slope.at<std::uint8_t>(y, x) - right_slope.at<std::uint8_t>(y, right_x);
        costs.at(x, y, d) = static_cast<int>((a ^ b).count()) + std::abs(slopes);
      }
    }
  }
  return costs;
}

int halfOf(int sum) { return (sum + 1) / 2; }

/// Half of every cost and half of the mean of those at (x - dx, y - dy) and (x + dx, y + dy).
Volume averages(const Volume& costs, const cv::Size& size, int disparities, int dx, int dy) {
  Volume result(size, disparities);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const int x_before = std::max(x - dx, 0), x_after = std::min(x + dx, size.width - 1);
      const int y_before = std::max(y - dy, 0), y_after = std::min(y + dy, size.height - 1);
      for (int d = 0; d < disparities; ++d) {
        const int beside = halfOf(costs.at(x_before, y_before, d) + costs.at(x_after, y_after, d));
        result.at(x, y, d) = halfOf(beside + costs.at(x, y, d));
      }
    }
  }
  return result;
}

Volume costsOf(const cv::Mat& left, const cv::Mat& right, const CensusSgmParameters& p) {
  const cv::Size size = left.size();
  const Volume costs = averages(costsOfPairs(left, right, p), size, p.disparity_range, 1, 0);
  return p.aggregate_rows ? averages(costs, size, p.disparity_range, 0, 1) : costs;
}

/// Adds the values of the path that comes to every pixel from (x - dx, y - dy).
void addPath(const Volume& costs, const cv::Size& size, const CensusSgmParameters& p, int dx, int dy,
             Volume& sums) {
  const int disparities = p.disparity_range;
  Volume values(size, disparities);
  for (int i = 0; i < size.height; ++i) {
    for (int j = 0; j < size.width; ++j) {
      const int y = dy < 0 ? size.height - 1 - i : i, x = dx < 0 ? size.width - 1 - j : j;
      const int x_before = x - dx, y_before = y - dy;
      const bool is_first = x_before < 0 || x_before >= size.width || y_before < 0 || y_before >= size.height;
      const auto before = [&](int d) { return values.at(x_before, y_before, d); };
      const int least = is_first ? 0 : before(values.winner(x_before, y_before));
      for (int d = 0; d < disparities; ++d) {
        int step = 0;
        if (!is_first) {
          step = std::min(before(d) - least, p.p2);
          if (d > 0) step = std::min(step, before(d - 1) - least + p.p1);
          if (d < disparities - 1) step = std::min(step, before(d + 1) - least + p.p1);
        }
        values.at(x, y, d) = costs.at(x, y, d) + step;
        sums.at(x, y, d) = std::min(sums.at(x, y, d) + values.at(x, y, d), LARGEST_SUM);
      }
    }
  }
}

bool isAmbiguous(const Volume& sums, int x, int y, int d, const CensusSgmParameters& p) {
  if (p.uniqueness_ratio == 0) return false;
  const int least = sums.at(x, y, d);
  for (int other = 0; other < p.disparity_range; ++other) {
    if (std::abs(other - d) <= 1) continue;
    const int sum = sums.at(x, y, other);
    if (sum == least || sum * (100 - p.uniqueness_ratio) < 100 * least) return true;
  }
  return false;
}

int winnerOfRightView(const Volume& sums, int right_x, int y, int width, const CensusSgmParameters& p) {
  int best = -1, least = 0;
  for (int d = 0; d < p.disparity_range; ++d) {
    const int x = right_x + p.min_disparity + d;
    if (x < 0 || x >= width) continue;
    if (best < 0 || sums.at(x, y, d) < least) {
      best = d;
      least = sums.at(x, y, d);
    }
  }
  return best;
}

int fraction(const Volume& sums, int x, int y, int d, const CensusSgmParameters& p) {
  if (d == 0 || d == p.disparity_range - 1) return 0;
  const int before = sums.at(x, y, d - 1) - sums.at(x, y, d);
  const int after = sums.at(x, y, d + 1) - sums.at(x, y, d);
  if (before == 0 && after == 0) return 0;
  const double slope = std::max(before, after);
  return static_cast<int>(std::floor(CensusSgm::SUBPIXEL_STEPS * (before - after) / (2.0 * slope) + 0.5));
}

short median(const cv::Mat& image, int x, int y) {
  std::array<short, 9> values{};
  for (int i = 0; i < 9; ++i) {
    values[i] = image.at<short>(std::clamp(y + i / 3 - 1, 0, image.rows - 1),
                                std::clamp(x + i % 3 - 1, 0, image.cols - 1));
  }
  std::sort(values.begin(), values.end());
  return values[4];
}

}  // namespace

cv::Mat censusBits(const cv::Mat& gray) {
  cv::Mat bits(gray.size(), CV_16UC1, cv::Scalar(0));
  for (int y = 0; y < gray.rows; ++y) {
    for (int x = 0; x < gray.cols; ++x) {
      int bit = 0;
      for (int dy = -3; dy <= 0; ++dy) {
        for (int dx = -4; dx <= (dy < 0 ? 4 : -1); ++dx) {
          if ((dx + dy) % 2 == 0) continue;
          const bool is_less = grayAt(gray, x + dx, y + dy) < grayAt(gray, x - dx, y - dy);
          bits.at<std::uint16_t>(y, x) |= static_cast<std::uint16_t>(is_less << bit);
          ++bit;
        }
      }
    }
  }
  return bits;
}

cv::Mat censusSlope(const cv::Mat& gray) {
  cv::Mat slope(gray.size(), CV_8UC1);
  for (int y = 0; y < gray.rows; ++y) {
    for (int x = 0; x < gray.cols; ++x) {
      const auto difference = [&](int row) { return grayAt(gray, x + 1, row) - grayAt(gray, x - 1, row); };
      const int sobel = difference(y - 1) + 2 * difference(y) + difference(y + 1);
      slope.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>((LARGEST_SLOPE + std::clamp(sobel, -LARGEST_SLOPE, LARGEST_SLOPE)) / 2);
    }
  }
  return slope;
}

cv::Mat matchCensus(const cv::Mat& left, const cv::Mat& right, const CensusSgmParameters& p) {
  const cv::Size size = left.size();
  const Volume costs = costsOf(left, right, p);
  Volume sums(size, p.disparity_range);
  addPath(costs, size, p, 1, 0, sums);
  addPath(costs, size, p, -1, 0, sums);
  addPath(costs, size, p, 0, 1, sums);
  addPath(costs, size, p, 0, -1, sums);

  cv::Mat disparities(size, CV_16SC1), is_good(size, CV_8UC1), result(size, CV_16SC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const int d = sums.winner(x, y), right_x = x - p.min_disparity - d;
      disparities.at<short>(y, x) =
          static_cast<short>(CensusSgm::SUBPIXEL_STEPS * d + fraction(sums, x, y, d, p));
      bool good = right_x >= 0 && right_x < size.width && !isAmbiguous(sums, x, y, d, p);
      if (good && p.disp12_max_diff >= 0) {
        good = std::abs(winnerOfRightView(sums, right_x, y, size.width, p) - d) <= p.disp12_max_diff;
      }
      is_good.at<std::uint8_t>(y, x) = good ? 1 : 0;
    }
  }
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const bool good = is_good.at<std::uint8_t>(y, x) != 0;
      result.at<short>(y, x) = good ? median(disparities, x, y) : CensusSgm::INVALID;
    }
  }
  return result;
}

}  // namespace straightforward
}  // namespace disparity_refinement
