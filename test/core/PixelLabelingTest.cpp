#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "PlaneScene.hpp"
#include "disparity_refinement/refinement/PixelLabeling.hpp"

namespace disparity_refinement {
namespace {

// The definition, word by word and pixel by pixel. Costs and disparities are integers: 1/16 px, disparities
// above the least one of the range.
class Straightforward {
 public:
  Straightforward(const PlaneScene& scene, const std::vector<FurtherPlanes>& further,
                  const PixelLabelingParameters& parameters)
      : scene_(scene), further_(further), p_(parameters) {}

  cv::Mat compute() {
    findPlanes();
    findCandidates();
    sums_.resize(candidates_.size());
    for (std::size_t i = 0; i < sums_.size(); ++i) sums_[i].assign(candidates_[i].size(), 0);
    for (const cv::Point direction : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
      addPaths(direction);
    }
    cv::Mat result(size(), CV_32FC1);
    for (int y = 0; y < size().height; ++y) {
      for (int x = 0; x < size().width; ++x) result.at<float>(y, x) = choose({x, y});
    }
    return result;
  }

 private:
  struct Candidate {
    int disparity, cost;
  };

  cv::Size size() const { return scene_.labels.size(); }
  int labelAt(const cv::Point& p) const { return scene_.labels.at<int>(p); }
  int index(const cv::Point& p) const { return p.y * size().width + p.x; }
  static int inSteps(double value) { return static_cast<int>(std::lround(16.0 * value)); }
  // Weights are multiples of 1/256, their products are cut.
  static int weigh(int value, double weight) {
    return (value * static_cast<int>(std::lround(256.0 * weight))) / 256;
  }

  // The pixels of the row about this one where no label changes: the first and the last column.
  std::pair<int, int> stretchAt(const cv::Point& pixel) const {
    const auto isSame = [&](int x) {
      if (x < 0 || x >= size().width || labelAt({x, pixel.y}) != labelAt(pixel)) return false;
      return std::all_of(further_.begin(), further_.end(), [&](const FurtherPlanes& other) {
        return other.labels->at<int>(pixel.y, x) == other.labels->at<int>(pixel);
      });
    };
    int first = pixel.x, last = pixel.x;
    while (isSame(first - 1)) --first;
    while (isSame(last + 1)) ++last;
    return {first, last};
  }

  // The planes that are candidates of a pixel, with their costs.
  std::vector<std::pair<DisparityPlane, int>> planesAt(const cv::Point& pixel, bool is_measured) const {
    const auto [first, last] = stretchAt(pixel);
    std::vector<std::pair<DisparityPlane, int>> planes;
    const auto add = [&, first = first, last = last](const DisparityPlane& plane, double with_measured,
                                                     double in_hole) {
      if (!plane.is_known || planes.size() == 7) return;
      for (const auto& [other, cost] : planes) {
        if (std::abs(plane.at(first, pixel.y) - other.at(first, pixel.y)) < 0.5 &&
            std::abs(plane.at(last, pixel.y) - other.at(last, pixel.y)) < 0.5)
          return;
      }
      planes.emplace_back(plane, planes.empty() ? 0 : inSteps(is_measured ? with_measured : in_hole));
    };
    const int label = labelAt(pixel);
    const std::vector<DisparityPlane>& own_and_neighbours = planes_[label];
    const std::size_t own = scene_.planes[label].is_known ? 1 : 0;
    for (std::size_t i = 0; i < own; ++i) add(own_and_neighbours[i], 0.0, 0.0);
    for (const FurtherPlanes& other : further_) {
      const int other_label = other.labels->at<int>(pixel);
      if (other_label >= 0) add((*other.planes)[other_label], p_.further_cost, p_.further_cost_in_hole);
    }
    for (std::size_t i = own; i < own_and_neighbours.size(); ++i) {
      add(own_and_neighbours[i], p_.neighbour_cost, p_.neighbour_cost_in_hole);
    }
    return planes;
  }

  // The planes of every segment: its own and those of the neighbours with the longest borders, up to 7.
  void findPlanes() {
    const int segments = static_cast<int>(scene_.planes.size());
    planes_.resize(segments);
    for (int label = 0; label < segments; ++label) {
      std::vector<std::pair<int, int>> neighbours = {{std::numeric_limits<int>::min(), label}};
      for (const auto& border : scene_.graph.bordersOf(label)) {
        neighbours.emplace_back(-border.length(), border.neighbour);
      }
      std::sort(neighbours.begin(), neighbours.end());
      std::vector<cv::Point> points;
      for (int y = 0; y < size().height; ++y) {
        for (int x = 0; x < size().width; ++x) {
          if (labelAt({x, y}) == label) points.emplace_back(x, y);
        }
      }
      const cv::Rect box = cv::boundingRect(points);
      for (const auto& [length, neighbour] : neighbours) {
        const DisparityPlane& plane = scene_.planes[neighbour];
        if (!plane.is_known || planes_[label].size() == 7) continue;
        const bool is_new = std::all_of(planes_[label].begin(), planes_[label].end(), [&](const auto& other) {
          double largest = 0.0;
          for (int y = box.y; y < box.y + box.height; ++y) {
            for (int x = box.x; x < box.x + box.width; ++x) {
              largest = std::max(largest, std::abs(plane.at(x, y) - other.at(x, y)));
            }
          }
          return largest >= 0.5;
        });
        if (is_new) planes_[label].push_back(plane);
      }
    }
  }

  // What the right camera sees at a column: the nearest of what was measured; infinity for nothing.
  float seenByRight(int column, int y) const {
    float nearest = std::numeric_limits<float>::infinity();
    if (column < 0 || column >= size().width) return nearest;
    for (int x = 0; x < size().width; ++x) {
      const float d = scene_.measured.at<float>(y, x);
      if (!scene_.range.isValid(d) || std::floor(x - d + 0.5F) != column) continue;
      if (nearest == std::numeric_limits<float>::infinity() || nearest < d) nearest = d;
    }
    return nearest;
  }

  // Whether something nearer was measured close by.
  bool isBehindEdge(const cv::Point& pixel) const {
    const cv::Rect reach(pixel.x - p_.edge_reach, pixel.y - p_.edge_reach, 2 * p_.edge_reach + 1,
                         2 * p_.edge_reach + 1);
    const cv::Rect window = reach & cv::Rect({0, 0}, size());
    for (int y = window.y; y < window.y + window.height; ++y) {
      for (int x = window.x; x < window.x + window.width; ++x) {
        const float d = scene_.measured.at<float>(y, x);
        if (scene_.range.isValid(d) && d - scene_.measured.at<float>(pixel) > p_.edge_step) return true;
      }
    }
    return false;
  }

  void findCandidates() {
    candidates_.resize(size().area());
    const int most = std::min(32767, static_cast<int>(16.0F * (scene_.range.max - scene_.range.min)));
    for (int y = 0; y < size().height; ++y) {
      for (int x = 0; x < size().width; ++x) {
        if (labelAt({x, y}) < 0) continue;
        std::vector<Candidate>& candidates = candidates_[index({x, y})];
        const float d = scene_.measured.at<float>(y, x);
        const bool is_measured = scene_.range.isValid(d);
        // What does not fit into 16 bits is the largest that does.
        const int own =
            static_cast<int>(std::floor(std::min(16.0F * (d - scene_.range.min), 32767.0F) + 0.5F));
        for (const auto& [plane, plane_cost] : planesAt({x, y}, is_measured)) {
          const double above = 16.0 * (plane.at(x, y) - scene_.range.min);
          const int disparity = static_cast<int>(std::nearbyint(std::min(std::max(above, 0.0), 1.0 * most)));
          int cost = plane_cost;
          if (is_measured) {
            const double weight = isBehindEdge({x, y}) ? p_.edge_share * p_.data_weight : p_.data_weight;
            cost += weigh(std::min(std::abs(disparity - own), inSteps(p_.data_truncation)), weight);
          }
          candidates.push_back({disparity, cost});
        }
        if (is_measured && (candidates.empty() || std::abs(candidates[0].disparity - own) > 8)) {
          candidates.push_back({own, inSteps(p_.measured_cost)});
        }
        if (candidates.size() < 2) continue;
        for (Candidate& candidate : candidates) {
          const float at = scene_.range.min + candidate.disparity / 16.0F;
          if (seenByRight(static_cast<int>(std::floor(x - at + 0.5F)), y) < at - 1.0F) {
            candidate.cost += inSteps(p_.visibility_cost);
          }
        }
      }
    }
  }

  void addPaths(const cv::Point& direction) {
    const cv::Rect image({0, 0}, size());
    std::vector<std::vector<int>> path(candidates_.size());
    for (int i = 0; i < size().area(); ++i) {
      const int k = direction.x + direction.y > 0 ? i : size().area() - 1 - i;
      const cv::Point here(k % size().width, k / size().width), before = here - direction;
      for (const Candidate& candidate : candidates_[k]) {
        int least = 0;
        if (image.contains(before) && !candidates_[index(before)].empty()) {
          least = std::numeric_limits<int>::max();
          const int contrast =
              std::abs(int{scene_.gray.at<std::uint8_t>(here)} - scene_.gray.at<std::uint8_t>(before));
          const double weight = p_.smoothness * p_.half_contrast / (p_.half_contrast + contrast);
          for (std::size_t j = 0; j < path[index(before)].size(); ++j) {
            const int step = std::abs(candidate.disparity - candidates_[index(before)][j].disparity);
            const int cost = weigh(std::min(step, inSteps(p_.step_truncation)), weight);
            least = std::min(least, path[index(before)][j] + cost);
          }
        }
        path[k].push_back(candidate.cost + least);
      }
      if (path[k].empty()) continue;
      if (image.contains(before)) {
        const int least = *std::min_element(path[k].begin(), path[k].end());
        for (int& value : path[k]) value -= least;
      }
      for (std::size_t j = 0; j < path[k].size(); ++j) sums_[k][j] += path[k][j];
    }
  }

  float choose(const cv::Point& pixel) const {
    const std::vector<Candidate>& candidates = candidates_[index(pixel)];
    if (candidates.empty()) return scene_.measured.at<float>(pixel);
    const std::vector<int>& sums = sums_[index(pixel)];
    const int best = static_cast<int>(std::min_element(sums.begin(), sums.end()) - sums.begin());
    double total = 0.0, weighted = 0.0;
    for (std::size_t i = 0; i < sums.size(); ++i) {
      if (std::abs(candidates[i].disparity - candidates[best].disparity) > inSteps(p_.soft_reach)) continue;
      // Powers of 1/2 down to a millionth, and straight lines between them.
      const double halvings = (sums[i] - sums[best]) / (4.0 * inSteps(p_.half_cost));
      if (halvings >= 20.0) continue;
      const double weight =
          std::pow(0.5, std::floor(halvings)) * (1.0 - 0.5 * (halvings - std::floor(halvings)));
      total += weight;
      weighted += weight * candidates[i].disparity;
    }
    return std::min(static_cast<float>(scene_.range.min + weighted / total / 16.0),
                    std::max(scene_.range.max, scene_.measured.at<float>(pixel)));
  }

  const PlaneScene& scene_;
  const std::vector<FurtherPlanes> further_;
  const PixelLabelingParameters p_;
  std::vector<std::vector<DisparityPlane>> planes_;
  std::vector<std::vector<Candidate>> candidates_;
  std::vector<std::vector<int>> sums_;
};

cv::Mat labelWith(PixelLabeling& labeling, const PlaneScene& scene, const PixelLabelingParameters& parameters,
                  const std::vector<FurtherPlanes>& further = {}) {
  cv::Mat result(scene.labels.size(), CV_32FC1, cv::Scalar(-77));
  labeling.compute(scene.measured, scene.gray, scene.range, scene.segments, scene.graph, scene.planes,
                   further, parameters, result);
  return result;
}

cv::Mat label(const PlaneScene& scene, const PixelLabelingParameters& parameters = {},
              const std::vector<FurtherPlanes>& further = {}) {
  PixelLabeling labeling;
  return labelWith(labeling, scene, parameters, further);
}

// Blocks as segments, some of label -1, planes and disparities exact in single precision, noise, and holes.
PlaneScene randomScene(cv::RNG& random, const cv::Size& size, const DisparityRange& range) {
  PlaneScene scene(size, range);
  const int block = random.uniform(2, 9), step = (size.width + block - 1) / block;
  std::vector<int> names;
  for (int i = 0; i < step * ((size.height + block - 1) / block); ++i)
    names.push_back(random.uniform(-1, i + 1));
  random.fill(scene.gray, cv::RNG::UNIFORM, 0, random.uniform(2, 256));
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) scene.labels.at<int>(y, x) = names[y / block * step + x / block];
  }
  scene.prepare();
  const float span = range.max - range.min;
  for (DisparityPlane& plane : scene.planes) {
    plane.a = random.uniform(-64, 65) / 128.0;
    plane.b = random.uniform(-64, 65) / 128.0;
    // Some are out of range.
    plane.c = range.min + std::round(64.0F * span * random.uniform(-0.1F, 1.1F)) / 64.0F;
    plane.is_known = random.uniform(0, 5) > 0;
  }
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      float& d = scene.measured.at<float>(y, x);
      const int name = scene.labels.at<int>(y, x), kind = random.uniform(0, 10);
      if (kind < 3) continue;
      if (kind < 5 || name < 0) {
        d = range.min + std::round(64.0F * span * random.uniform(0.0F, 1.0F)) / 64.0F;
      } else {
        d = static_cast<float>(scene.planes[name].at(x, y)) + random.uniform(-128, 129) / 64.0F;
        if (!range.isValid(d)) d = range.invalid();
      }
    }
  }
  return scene;
}

TEST(PixelLabeling, isTheStraightforwardOne) {
  cv::RNG random(11);
  PixelLabeling labeling;  // One for all: nothing of a former map is left.
  double soft = 0.0;
  for (int trial = 0; trial < 200; ++trial) {
    const cv::Size size(random.uniform(1, 40), random.uniform(1, 30));
    const DisparityRange ranges[] = {{0.0F, 32.0F}, {-16.0F, 16.0F}, {3.0F, 11.0F}, {0.0F, 2048.0F}};
    const PlaneScene scene = randomScene(random, size, ranges[trial % 4]);
    PixelLabelingParameters parameters;
    if (trial % 3 == 1) {  // As far as they may go.
      parameters.data_weight = 10.0;
      parameters.data_truncation = 1.5;
      parameters.edge_share = 0.0;
      parameters.edge_reach = 16;
      parameters.edge_step = 0.0;
      parameters.neighbour_cost = parameters.neighbour_cost_in_hole = 100.0;
      parameters.further_cost = parameters.further_cost_in_hole = 100.0;
      parameters.measured_cost = parameters.visibility_cost = 100.0;
      parameters.smoothness = 0.9375;
      parameters.step_truncation = 16.0;
      parameters.soft_reach = 1000.0;
      parameters.half_cost = 100.0;
    } else if (trial % 3 == 2) {
      parameters.data_weight = random.uniform(0.0, 3.0);
      parameters.edge_share = random.uniform(0.0, 1.0);
      parameters.edge_reach = random.uniform(0, 6);
      parameters.edge_step = random.uniform(0.0, 6.0);
      parameters.neighbour_cost = random.uniform(0.0, 2.0);
      parameters.neighbour_cost_in_hole = random.uniform(0.0, 2.0);
      parameters.further_cost = random.uniform(0.0, 2.0);
      parameters.further_cost_in_hole = random.uniform(0.0, 2.0);
      parameters.measured_cost = random.uniform(0.0, 2.0);
      parameters.visibility_cost = random.uniform(0.0, 2.0);
      parameters.smoothness = random.uniform(0.0, 3.5);
      parameters.half_contrast = random.uniform(1.0, 100.0);
      parameters.soft_reach = random.uniform(0.0, 8.0);
      parameters.half_cost = random.uniform(0.1, 4.0);
    }
    // Other segmentations: those of other scenes.
    std::vector<PlaneScene> others;
    for (int i = 0; i < trial % 4; ++i) others.push_back(randomScene(random, size, ranges[trial % 4]));
    std::vector<FurtherPlanes> further;
    for (const PlaneScene& other : others) further.push_back({&other.labels, &other.planes});
    const cv::Mat result = labelWith(labeling, scene, parameters, further);
    const cv::Mat expected = Straightforward(scene, further, parameters).compute();
    // Means of 8 values in single precision.
    const float tolerance = 2e-6F * (scene.range.max - scene.range.min) + 1e-5F;
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        ASSERT_NEAR(result.at<float>(y, x), expected.at<float>(y, x), tolerance)
            << "trial " << trial << ", x " << x << ", y " << y;
        const float steps = 16.0F * expected.at<float>(y, x);
        soft += steps != std::floor(steps) && scene.labels.at<int>(y, x) >= 0 ? 1.0 / size.area() : 0.0;
      }
    }
  }
  EXPECT_GT(soft / 200, 0.1);
}

TEST(PixelLabeling, takesThePlaneWhereItIsAllThereIs) {
  // Measured values near enough, and holes; the slope shows in steps of 1/16 px.
  PlaneScene scene({30, 20});
  const DisparityPlane plane{0.125, -0.25, 20.0, true};
  scene.measure(0, plane);
  scene.measured.colRange(5, 9).setTo(scene.range.invalid());
  scene.measured.colRange(20, 22) += cv::Scalar(0.5);
  scene.measured.colRange(22, 24) -= cv::Scalar(0.5);
  scene.prepare();
  scene.planes = {plane};
  const cv::Mat result = label(scene);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x) EXPECT_EQ(result.at<float>(y, x), plane.at(x, y)) << x << ", " << y;
  }
}

TEST(PixelLabeling, keepsAThinPole) {
  // It has no segment of its own; the image shows it.
  PlaneScene scene({40, 30});
  const DisparityPlane wall{0.0, 0.0, 20.0, true};
  scene.measure(0, wall);
  scene.measured.colRange(20, 23).setTo(40.0F);
  scene.gray.colRange(20, 23).setTo(30);
  scene.prepare();
  scene.planes = {wall};
  const cv::Mat result = label(scene);
  for (int x = 0; x < 40; ++x)
    EXPECT_NEAR(result.at<float>(15, x), x >= 20 && x < 23 ? 40.0 : 20.0, 0.25) << x;
}

TEST(PixelLabeling, overrulesASingleOutlier) {
  PlaneScene scene({40, 30});
  const DisparityPlane wall{0.0, 0.0, 20.0, true};
  scene.measure(0, wall);
  scene.measured.at<float>(15, 20) = 40.0F;
  scene.measured.at<float>(7, 9) = 23.0F;
  scene.prepare();
  scene.planes = {wall};
  PixelLabelingParameters parameters;
  EXPECT_EQ(label(scene, parameters).at<float>(15, 20), 20.0F);
  EXPECT_NEAR(label(scene, parameters).at<float>(7, 9), 20.0, 0.5);
  // A measured value costs nothing, and nor do steps.
  parameters.measured_cost = parameters.smoothness = 0.0;
  EXPECT_EQ(label(scene, parameters).at<float>(15, 20), 40.0F);
}

TEST(PixelLabeling, fillsTheHoleBesideABoxWithTheWall) {
  // A box before a wall. The left camera sees wall on the left of the box that the right one does not:
  // nothing was measured there, and no gray value tells whether it is of the box, to whose segment it
  // belongs.
  const DisparityPlane wall{0.0, 0.0, 10.0, true}, box{0.0, 0.0, 18.0, true};
  PlaneScene scene({80, 30});
  scene.measure(0, wall);
  scene.measured.colRange(32, 60).setTo(18.0F);
  scene.measured.colRange(24, 32).setTo(scene.range.invalid());
  scene.labels.colRange(24, 60).setTo(1);
  scene.gray.colRange(32, 60).setTo(130);
  scene.prepare();
  scene.planes = {wall, box};
  const cv::Mat result = label(scene);
  for (int x = 0; x < 80; ++x) {
    EXPECT_EQ(result.at<float>(15, x), x >= 32 && x < 60 ? 18.0F : 10.0F) << x;
  }
  // It is the visibility, and the edge, that tell.
  PixelLabelingParameters parameters;
  parameters.visibility_cost = 0.0;
  scene.gray.setTo(100);
  EXPECT_EQ(label(scene, parameters).at<float>(15, 30), 18.0F);
}

TEST(PixelLabeling, takesTheNeighboursPlaneWhereItWasMeasured) {
  // The segment reaches 6 columns too far; those beside the step count as much as the others.
  const DisparityPlane left{0.0, 0.0, 10.0, true}, right{0.0, 0.0, 30.0, true};
  PlaneScene scene({60, 20});
  scene.measure(0, left);
  scene.labels.colRange(24, 60).setTo(1);
  scene.measured.colRange(30, 60).setTo(30.0F);
  scene.gray.colRange(30, 60).setTo(200);
  scene.prepare();
  scene.planes = {left, right};
  PixelLabelingParameters parameters;
  parameters.edge_share = 1.0;
  const cv::Mat result = label(scene, parameters);
  for (int x = 0; x < 60; ++x) EXPECT_EQ(result.at<float>(10, x), x < 30 ? 10.0F : 30.0F) << x;
}

TEST(PixelLabeling, believesTheImageBesideADepthStep) {
  // The measured map begins 2 columns behind the edge of a near thing that its segment keeps to.
  const DisparityPlane wall{0.0, 0.0, 10.0, true}, near{0.0, 0.0, 30.0, true};
  PlaneScene scene({80, 20});
  scene.measure(0, wall);
  scene.labels.colRange(40, 80).setTo(1);
  scene.gray.colRange(40, 80).setTo(200);
  scene.measured.colRange(42, 80).setTo(30.0F);
  scene.measured.colRange(20, 40).setTo(scene.range.invalid());  // The right camera does not see it.
  scene.prepare();
  scene.planes = {wall, near};
  PixelLabelingParameters parameters;
  const cv::Mat result = label(scene, parameters);
  for (int x = 0; x < 80; ++x) EXPECT_EQ(result.at<float>(10, x), x < 40 ? 10.0F : 30.0F) << x;
  // Beyond the reach, for smaller steps, and with the full weight it believes what was measured.
  const auto expectMeasured = [&](const PixelLabelingParameters& changed) {
    const cv::Mat other = label(scene, changed);
    for (int x = 0; x < 80; ++x) EXPECT_EQ(other.at<float>(10, x), x < 42 ? 10.0F : 30.0F) << x;
  };
  parameters.edge_share = 1.0;
  expectMeasured(parameters);
  parameters = {};
  parameters.edge_reach = 0;
  expectMeasured(parameters);
  parameters = {};
  parameters.edge_step = 20.0;
  expectMeasured(parameters);
}

TEST(PixelLabeling, leavesPixelsOfNoSegment) {
  PlaneScene scene({20, 10});
  const DisparityPlane plane{0.0, 0.0, 20.0, true};
  scene.measured.setTo(25.03F);
  scene.labels.colRange(8, 12).setTo(-1);
  scene.measured.col(9).setTo(scene.range.invalid());
  scene.prepare();
  scene.planes = {plane};
  const cv::Mat result = label(scene);
  EXPECT_EQ(cv::norm(result.colRange(8, 12), scene.measured.colRange(8, 12), cv::NORM_INF), 0.0);
}

TEST(PixelLabeling, keepsWhatWasMeasuredWhereNoPlaneIsKnown) {
  PlaneScene scene({20, 10});
  scene.measured.colRange(3, 9).setTo(25.0625F);
  scene.prepare();
  EXPECT_EQ(cv::norm(label(scene), scene.measured, cv::NORM_INF), 0.0);
}

TEST(PixelLabeling, staysWithinTheRange) {
  PlaneScene scene({40, 30}, {-8.0F, 8.0F});
  scene.labels.colRange(20, 40).setTo(1);
  scene.measured.setTo(2.0F);
  scene.prepare();
  scene.planes = {{0.9, 1.5, -30.0, true}, {-0.9, -1.5, 30.0, true}};
  double least, largest;
  cv::minMaxLoc(label(scene), &least, &largest);
  EXPECT_GE(least, -8.0);
  EXPECT_LE(largest, 8.0);
  scene.measured.setTo(scene.range.invalid());
  cv::minMaxLoc(label(scene), &least, &largest);
  EXPECT_EQ(least, -8.0);
  EXPECT_EQ(largest, 8.0);
}

TEST(PixelLabeling, liesBetweenCandidatesNearEachOther) {
  // One pixel: four times the costs, no steps. Measured 22 px, planes at 20 and, of the neighbour, 23 px.
  PlaneScene scene({2, 1});
  scene.labels.at<int>(0, 1) = 1;
  scene.measured.at<float>(0, 0) = 22.0F;
  scene.prepare();
  scene.planes = {{0.0, 0.0, 20.0, true}, {0.0, 0.0, 23.0, true}};
  PixelLabelingParameters parameters;
  parameters.smoothness = parameters.visibility_cost = 0.0;
  parameters.data_weight = 1.0;
  parameters.data_truncation = 8.0;
  parameters.neighbour_cost = 1.0;
  parameters.measured_cost = 3.0;
  parameters.half_cost = 1.0;  // Costs 2, 2 and 3: weights 1, 1 and 1/2.
  EXPECT_FLOAT_EQ(label(scene, parameters).at<float>(0, 0), (20.0F + 23.0F + 0.5F * 22.0F) / 2.5F);
  parameters.half_cost = 0.5;
  EXPECT_FLOAT_EQ(label(scene, parameters).at<float>(0, 0), (20.0F + 23.0F + 0.25F * 22.0F) / 2.25F);
  // The first of two equal ones wins; the other one is too far away.
  parameters.soft_reach = 2.5;
  EXPECT_FLOAT_EQ(label(scene, parameters).at<float>(0, 0), (20.0F + 0.25F * 22.0F) / 1.25F);
  parameters.soft_reach = 0.0;
  EXPECT_EQ(label(scene, parameters).at<float>(0, 0), 20.0F);
  parameters.measured_cost = 0.0;
  EXPECT_EQ(label(scene, parameters).at<float>(0, 0), 22.0F);
}

TEST(PixelLabeling, takesNeighboursInTheOrderOfTheLengthOfTheirBorders) {
  // A segment without a plane has more neighbours than candidates: that with the shortest border is left out,
  // though it is all that was measured around.
  PlaneScene scene({40, 3});
  scene.labels.setTo(0);
  for (int i = 0; i < 8; ++i) scene.labels(cv::Rect(5 * i, 0, i == 3 ? 4 : 5, 1)).setTo(i + 1);
  scene.labels.at<int>(0, 19) = 5;
  scene.prepare();
  for (int i = 0; i < 8; ++i) scene.planes[i + 1] = {0.0, 0.0, 10.0 + 5.0 * i, true};
  PixelLabelingParameters parameters;
  parameters.soft_reach = 1000.0;
  parameters.half_cost = 100.0;
  parameters.smoothness = 0.0;
  parameters.neighbour_cost_in_hole = 0.0;
  // The mean of all candidates but that of label 4, 25 px.
  EXPECT_FLOAT_EQ(label(scene, parameters).at<float>(2, 7), (8 * 27.5F - 25.0F) / 7);
}

TEST(PixelLabeling, takesThePlaneOfAFurtherSegmentation) {
  // One segment over a depth step, of which the one side was measured; another segmentation has both sides.
  const DisparityPlane left{0.0, 0.0, 10.0, true}, right{0.0, 0.0, 30.0, true};
  PlaneScene scene({60, 5});
  scene.measured.colRange(0, 60).setTo(30.0F);
  scene.measured.colRange(0, 30).setTo(10.0F);
  scene.measured.colRange(12, 30).setTo(scene.range.invalid());
  scene.gray.colRange(30, 60).setTo(200);
  scene.prepare();
  scene.planes = {right};
  cv::Mat labels(scene.labels.size(), CV_32SC1, cv::Scalar(-1));
  labels.colRange(0, 30).setTo(1);
  std::vector<DisparityPlane> planes = {{}, left};
  PixelLabelingParameters parameters;
  const cv::Mat result = label(scene, parameters, {{&labels, &planes}});
  for (int x = 0; x < 60; ++x) EXPECT_EQ(result.at<float>(2, x), x < 30 ? 10.0F : 30.0F) << x;
  // Its cost tells, and where it is unknown or of no segment it is no candidate.
  parameters.further_cost = parameters.further_cost_in_hole = 100.0;
  EXPECT_EQ(label(scene, parameters, {{&labels, &planes}}).at<float>(2, 20), 30.0F);
  parameters = {};
  planes[1].is_known = false;
  EXPECT_EQ(label(scene, parameters, {{&labels, &planes}}).at<float>(2, 20), 30.0F);
  planes[1].is_known = true;
  labels.setTo(-1);
  EXPECT_EQ(label(scene, parameters, {{&labels, &planes}}).at<float>(2, 20), 30.0F);
}

TEST(PixelLabeling, isTheSameForAnyNumberOfThreads) {
  cv::RNG random(5);
  const int threads_before = cv::getNumThreads();
  for (const cv::Size size : {cv::Size(97, 61), cv::Size(3, 50), cv::Size(50, 2), cv::Size(1, 1)}) {
    const PlaneScene scene = randomScene(random, size, {0.0F, 64.0F});
    const PlaneScene other = randomScene(random, size, {0.0F, 64.0F});
    const std::vector<FurtherPlanes> further = {{&other.labels, &other.planes}};
    cv::setNumThreads(1);
    const cv::Mat expected = label(scene, {}, further);
    for (const int threads : {2, 3, 7}) {
      cv::setNumThreads(threads);
      EXPECT_EQ(cv::norm(label(scene, {}, further), expected, cv::NORM_INF), 0.0) << threads;
    }
  }
  cv::setNumThreads(threads_before);
}

}  // namespace
}  // namespace disparity_refinement
