#pragma once

// Slow and obvious versions of the segmentation's operators, written from their definitions, and random
// images on which the fast versions must give the same, exactly.

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <opencv2/core.hpp>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "disparity_refinement/segmentation/Connectivity.hpp"

namespace disparity_refinement {
namespace reference {

constexpr Connectivity BOTH_CONNECTIVITIES[] = {Connectivity::FOUR, Connectivity::EIGHT};

inline cv::Rect frameOf(const cv::Mat& image) { return {0, 0, image.cols, image.rows}; }

/// The neighbours of a pixel inside the image, in the order W, E, N, S, NW, NE, SW, SE.
inline std::vector<cv::Point> neighboursOf(const cv::Mat& image, cv::Point p, Connectivity connectivity) {
  const cv::Point steps[] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}};
  std::vector<cv::Point> neighbours;
  for (int i = 0; i < static_cast<int>(connectivity); ++i) {
    if (frameOf(image).contains(p + steps[i])) neighbours.push_back(p + steps[i]);
  }
  return neighbours;
}

/// All pixels, row after row.
inline std::vector<cv::Point> pixelsOf(const cv::Mat& image) {
  std::vector<cv::Point> pixels;
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) pixels.emplace_back(x, y);
  }
  return pixels;
}

/// The pixels that are connected with the seed through pixels that belong to the set.
inline std::vector<cv::Point> connectedComponent(const cv::Mat& image, cv::Point seed,
                                                 Connectivity connectivity,
                                                 const std::function<bool(cv::Point)>& belongs) {
  cv::Mat seen(image.size(), CV_8UC1, cv::Scalar(0));
  std::vector<cv::Point> component = {seed};
  seen.at<std::uint8_t>(seed) = 1;
  for (std::size_t k = 0; k < component.size(); ++k) {
    for (const cv::Point q : neighboursOf(image, component[k], connectivity)) {
      if (seen.at<std::uint8_t>(q) != 0 || !belongs(q)) continue;
      seen.at<std::uint8_t>(q) = 1;
      component.push_back(q);
    }
  }
  return component;
}

/// CC_t(p): the component of {f <= t} that holds p.
inline std::vector<cv::Point> lowerComponent(const cv::Mat& f, int t, cv::Point p,
                                             Connectivity connectivity) {
  return connectedComponent(f, p, connectivity, [&](cv::Point q) { return f.at<std::uint8_t>(q) <= t; });
}

/// Threshold decomposition: out(p) = min { t : |CC_t(p)| >= lambda }; where there is no such t, the largest
/// value.
inline cv::Mat areaClosing(const cv::Mat& f, int lambda, Connectivity connectivity) {
  const std::set<int> levels(f.begin<std::uint8_t>(), f.end<std::uint8_t>());
  cv::Mat out(f.size(), CV_8UC1, cv::Scalar(*levels.rbegin()));
  for (auto t = levels.rbegin(); t != levels.rend(); ++t) {
    cv::Mat seen(f.size(), CV_8UC1, cv::Scalar(0));
    for (const cv::Point p : pixelsOf(f)) {
      if (f.at<std::uint8_t>(p) > *t || seen.at<std::uint8_t>(p) != 0) continue;
      const std::vector<cv::Point> component = lowerComponent(f, *t, p, connectivity);
      for (const cv::Point q : component) {
        seen.at<std::uint8_t>(q) = 1;
        if (static_cast<int>(component.size()) >= lambda)
          out.at<std::uint8_t>(q) = static_cast<std::uint8_t>(*t);
      }
    }
  }
  return out;
}

/// Reconstruction by erosion of f + h over f: geodesic erosions of size 1 until nothing changes.
inline cv::Mat hMinima(const cv::Mat& f, int h, Connectivity connectivity) {
  cv::Mat limit;
  f.convertTo(limit, CV_32SC1);
  cv::Mat marker = limit + h;
  while (true) {
    cv::Mat eroded(f.size(), CV_32SC1);
    for (const cv::Point p : pixelsOf(f)) {
      int lowest = marker.at<int>(p);
      for (const cv::Point q : neighboursOf(f, p, connectivity)) lowest = std::min(lowest, marker.at<int>(q));
      eroded.at<int>(p) = std::max(lowest, limit.at<int>(p));
    }
    if (std::equal(eroded.begin<int>(), eroded.end<int>(), marker.begin<int>())) break;
    marker = eroded;
  }
  cv::Mat out;
  marker.convertTo(out, CV_8UC1);
  return out;
}

/// The local condition watershed with everything that the tests look at.
struct Watershed {
  int count = 0;
  cv::Mat labels;      ///< CV_32SC1
  cv::Mat is_minimum;  ///< CV_8UC1: the pixel is in a regional minimum.
  cv::Mat distance;    ///< CV_32SC1: the lower distance D, 0 in a minimum.
  std::vector<std::set<int>>
      reachable;  ///< Per pixel, the minima at the ends of all paths of steepest descent.

  /// The pixels that p may point to, before ties are broken.
  std::vector<cv::Point> candidates(const cv::Mat& f, cv::Point p, Connectivity connectivity) const {
    const int value = f.at<std::uint8_t>(p);
    int lowest = value;
    for (const cv::Point q : neighboursOf(f, p, connectivity)) {
      lowest = std::min<int>(lowest, f.at<std::uint8_t>(q));
    }
    std::vector<cv::Point> result;
    for (const cv::Point q : neighboursOf(f, p, connectivity)) {
      if (f.at<std::uint8_t>(q) != lowest) continue;
      if (lowest < value || distance.at<int>(q) == distance.at<int>(p) - 1) result.push_back(q);
    }
    return result;
  }

  const std::set<int>& reachableFrom(cv::Point p) const { return reachable[p.y * labels.cols + p.x]; }
};

inline Watershed watershed(const cv::Mat& f, Connectivity connectivity) {
  Watershed result;
  result.labels = cv::Mat(f.size(), CV_32SC1, cv::Scalar(-1));
  result.is_minimum = cv::Mat(f.size(), CV_8UC1, cv::Scalar(0));
  result.reachable.resize(f.total());
  const auto value = [&](cv::Point p) { return f.at<std::uint8_t>(p); };
  const auto hasLower = [&](cv::Point p) {
    const auto neighbours = neighboursOf(f, p, connectivity);
    return std::any_of(neighbours.begin(), neighbours.end(),
                       [&](cv::Point q) { return value(q) < value(p); });
  };
  const std::vector<cv::Point> pixels = pixelsOf(f);

  for (const cv::Point p : pixels) {
    if (result.labels.at<int>(p) >= 0) continue;
    const auto zone =
        connectedComponent(f, p, connectivity, [&](cv::Point q) { return value(q) == value(p); });
    if (std::any_of(zone.begin(), zone.end(), hasLower)) continue;
    for (const cv::Point q : zone) {
      result.labels.at<int>(q) = result.count;
      result.is_minimum.at<std::uint8_t>(q) = 1;
      result.reachable[q.y * f.cols + q.x] = {result.count};
    }
    ++result.count;
  }

  // D, by relaxation until nothing changes.
  const int unknown = std::numeric_limits<int>::max() - 1;
  result.distance = cv::Mat(f.size(), CV_32SC1, cv::Scalar(unknown));
  for (const cv::Point p : pixels) {
    if (result.is_minimum.at<std::uint8_t>(p) != 0) result.distance.at<int>(p) = 0;
    if (hasLower(p)) result.distance.at<int>(p) = 1;
  }
  for (bool changed = true; changed;) {
    changed = false;
    for (const cv::Point p : pixels) {
      for (const cv::Point q : neighboursOf(f, p, connectivity)) {
        const int through_q = result.distance.at<int>(q) + 1;
        if (value(q) != value(p) || through_q >= result.distance.at<int>(p)) continue;
        result.distance.at<int>(p) = through_q;
        changed = true;
      }
    }
  }

  // By value and distance: the targets of a pixel come before it.
  std::multimap<std::pair<int, int>, cv::Point> upward;
  for (const cv::Point p : pixels) {
    if (result.is_minimum.at<std::uint8_t>(p) != 0) continue;
    upward.emplace(std::make_pair(value(p), result.distance.at<int>(p)), p);
  }
  for (const auto& [order, p] : upward) {
    const std::vector<cv::Point> candidates = result.candidates(f, p, connectivity);
    result.labels.at<int>(p) = result.labels.at<int>(candidates.front());
    for (const cv::Point q : candidates) {
      const std::set<int>& further = result.reachableFrom(q);
      result.reachable[p.y * f.cols + p.x].insert(further.begin(), further.end());
    }
  }
  return result;
}

/// Small images with few gray values, which have many plateaus and ties; some near 255, some with all 256
/// values; a row, a column or a single pixel now and then. The same images on every run.
class RandomImages {
 public:
  explicit RandomImages(unsigned seed) : random_(seed) {}

  int uniform(int min, int max) {
    return min + static_cast<int>(random_() % static_cast<unsigned>(max - min + 1));
  }

  cv::Mat next() {
    const int shape = uniform(0, 9);
    const int rows = shape == 0 || shape == 1 ? 1 : uniform(1, 10);
    const int cols = shape == 0 || shape == 2 ? 1 : uniform(1, 10);
    const int palette = uniform(0, 3);
    const int values = palette == 0 ? 256 : uniform(2, 6);
    const int step = palette == 0 ? 1 : uniform(1, 12);
    const int lowest = palette == 0   ? 0
                       : palette == 1 ? 255 - (values - 1) * step
                                      : uniform(0, 255 - (values - 1) * step);
    cv::Mat image(rows, cols, CV_8UC1);
    for (const cv::Point p : pixelsOf(image)) {
      image.at<std::uint8_t>(p) = static_cast<std::uint8_t>(lowest + step * uniform(0, values - 1));
    }
    return image;
  }

 private:
  std::mt19937 random_;
};

/// The message of the exception that a call throws; empty if it throws none or one of another type.
template <typename Exception, typename Call>
std::string messageOf(Call call) {
  try {
    call();
  } catch (const Exception& error) {
    return error.what();
  }
  return "";
}

inline bool identical(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0.0;
}

/// A copy of the image that is a part of a larger one, which is full of another value: its rows do not touch.
inline cv::Mat insideLarger(const cv::Mat& image, int surrounding) {
  cv::Mat larger(image.rows + 5, image.cols + 7, image.type(), cv::Scalar(surrounding));
  cv::Mat part = larger(cv::Rect(3, 2, image.cols, image.rows));
  image.copyTo(part);
  return part;
}

}  // namespace reference
}  // namespace disparity_refinement
