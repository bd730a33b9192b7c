#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <map>
#include <vector>

#include "disparity_refinement/refinement/SegmentGraph.hpp"

namespace disparity_refinement {
namespace {

using Points = std::vector<SegmentGraph::BorderPoint>;
// Points of every border by the two labels, in both orders.
using Graph = std::map<int, std::map<int, Points>>;

// Looks at every pixel and the two after it, word by word.
Graph straightforward(const cv::Mat& labels, const cv::Mat& gray, double half_contrast) {
  Graph graph;
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      for (const cv::Point after : {cv::Point(x + 1, y), cv::Point(x, y + 1)}) {
        if (after.x >= labels.cols || after.y >= labels.rows) continue;
        const int a = labels.at<int>(y, x), b = labels.at<int>(after);
        if (a < 0 || b < 0 || a == b) continue;
        const int contrast = std::abs(int{gray.at<std::uint8_t>(y, x)} - gray.at<std::uint8_t>(after));
        const SegmentGraph::BorderPoint point{(x + after.x) / 2.0F, (y + after.y) / 2.0F,
                                              static_cast<float>(half_contrast / (half_contrast + contrast))};
        graph[a][b].push_back(point);
        graph[b][a].push_back(point);
      }
    }
  }
  return graph;
}

void expectGraph(const SegmentGraph& graph, int segments, const Graph& expected) {
  for (int segment = 0; segment < segments; ++segment) {
    std::map<int, Points> neighbours;
    if (const auto found = expected.find(segment); found != expected.end()) neighbours = found->second;
    auto neighbour = neighbours.begin();
    for (const SegmentGraph::Border& border : graph.bordersOf(segment)) {
      ASSERT_NE(neighbour, neighbours.end()) << "segment " << segment << " has too many borders";
      const auto& [label, points] = *neighbour++;
      ASSERT_EQ(border.neighbour, label) << "of segment " << segment;
      ASSERT_EQ(border.length(), static_cast<int>(points.size())) << segment << " and " << label;
      for (int i = 0; i < border.length(); ++i) {
        const SegmentGraph::BorderPoint& point = graph.point(border.first_point + i);
        ASSERT_EQ(point.x, points[i].x) << segment << " and " << label << ", point " << i;
        ASSERT_EQ(point.y, points[i].y) << segment << " and " << label << ", point " << i;
        ASSERT_EQ(point.weight, points[i].weight) << segment << " and " << label << ", point " << i;
      }
    }
    ASSERT_EQ(neighbour, neighbours.end()) << "segment " << segment << " has too few borders";
  }
}

cv::Mat grayOf(const cv::Mat& labels, int value = 100) { return {labels.size(), CV_8UC1, cv::Scalar(value)}; }

int bordersOf(const SegmentGraph& graph, int segment) {
  return static_cast<int>(graph.bordersOf(segment).end() - graph.bordersOf(segment).begin());
}

TEST(SegmentGraph, isTheStraightforwardOne) {
  cv::RNG random(3);
  SegmentGraph graph;  // One for all: nothing of a former map is left.
  for (int trial = 0; trial < 300; ++trial) {
    const cv::Size size(random.uniform(1, 25), random.uniform(1, 25));
    const int segments = random.uniform(1, size.area() + 1);
    cv::Mat labels(size, CV_32SC1), gray(size, CV_8UC1);
    random.fill(labels, cv::RNG::UNIFORM, trial % 2 == 0 ? 0 : -2, segments);
    if (trial % 3 == 0) {  // Larger segments: borders of many points.
      for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) labels.at<int>(y, x) = labels.at<int>(y / 4 * 4, x / 5 * 5);
      }
    }
    random.fill(gray, cv::RNG::UNIFORM, 0, 256);
    const double half_contrast = random.uniform(0.5, 50.0);
    graph.build(labels, gray, segments, half_contrast);
    expectGraph(graph, segments, straightforward(labels, gray, half_contrast));
    if (HasFatalFailure()) FAIL() << "trial " << trial;
  }
}

TEST(SegmentGraph, listsTheBordersOfASegmentByLabelAndTheirPointsInRasterOrder) {
  const cv::Mat labels = (cv::Mat_<int>(3, 3) << 4, 4, 2,  //
                          1, 4, 2,                         //
                          1, 1, 4);
  SegmentGraph graph;
  graph.build(labels, grayOf(labels), 5, 10.0);
  const SegmentGraph::Borders borders = graph.bordersOf(4);
  ASSERT_EQ(bordersOf(graph, 4), 2);
  EXPECT_EQ(borders.begin()[0].neighbour, 1);
  EXPECT_EQ(borders.begin()[1].neighbour, 2);
  const auto expectPoints = [&](const SegmentGraph::Border& border, const std::vector<cv::Point2f>& points) {
    ASSERT_EQ(border.length(), static_cast<int>(points.size()));
    for (int i = 0; i < border.length(); ++i) {
      EXPECT_EQ(graph.point(border.first_point + i).x, points[i].x) << i;
      EXPECT_EQ(graph.point(border.first_point + i).y, points[i].y) << i;
    }
  };
  expectPoints(borders.begin()[0], {{0.0F, 0.5F}, {0.5F, 1.0F}, {1.0F, 1.5F}, {1.5F, 2.0F}});
  expectPoints(borders.begin()[1], {{1.5F, 0.0F}, {1.5F, 1.0F}, {2.0F, 1.5F}});
  // Both segments of a border share its points.
  EXPECT_EQ(graph.bordersOf(2).begin()->first_point, borders.begin()[1].first_point);
  EXPECT_EQ(bordersOf(graph, 2), 1);
  // No pixel has these labels.
  EXPECT_EQ(bordersOf(graph, 0), 0);
  EXPECT_EQ(bordersOf(graph, 3), 0);
}

TEST(SegmentGraph, weighsAPointByTheContrast) {
  const cv::Mat labels = (cv::Mat_<int>(1, 6) << 0, 1, 2, 3, 4, 5);
  const cv::Mat gray = (cv::Mat_<std::uint8_t>(1, 6) << 50, 50, 60, 30, 0, 255);
  SegmentGraph graph;
  graph.build(labels, gray, 6, 10.0);
  const auto weightAfter = [&](int segment) {
    return graph.point(std::prev(graph.bordersOf(segment).end())->first_point).weight;
  };
  EXPECT_EQ(weightAfter(0), 1.0F);
  EXPECT_EQ(weightAfter(1), 0.5F);
  EXPECT_EQ(weightAfter(2), 0.25F);
  EXPECT_EQ(weightAfter(3), 0.25F);
  EXPECT_EQ(weightAfter(4), 10.0F / 265.0F);
  graph.build(labels, gray, 6, 30.0);
  EXPECT_EQ(weightAfter(1), 0.75F);
  EXPECT_EQ(weightAfter(2), 0.5F);
}

TEST(SegmentGraph, hasNoBorderToNegativeLabels) {
  const cv::Mat labels = (cv::Mat_<int>(2, 4) << 0, -1, 1, -5, 0, 0, std::numeric_limits<int>::min(),
                          std::numeric_limits<int>::min());
  SegmentGraph graph;
  graph.build(labels, grayOf(labels), 2, 10.0);
  EXPECT_EQ(bordersOf(graph, 0), 0);
  EXPECT_EQ(bordersOf(graph, 1), 0);
}

TEST(SegmentGraph, hasNoBordersInOneSegmentOrNone) {
  cv::Mat labels = cv::Mat::zeros(5, 7, CV_32SC1);
  SegmentGraph graph;
  graph.build(labels, grayOf(labels), 1, 10.0);
  EXPECT_EQ(bordersOf(graph, 0), 0);
  labels.setTo(-1);
  graph.build(labels, grayOf(labels), 0, 10.0);  // No segment to ask for.
  graph.build(cv::Mat::zeros(1, 1, CV_32SC1), cv::Mat::zeros(1, 1, CV_8UC1), 1, 10.0);
  EXPECT_EQ(bordersOf(graph, 0), 0);
}

TEST(SegmentGraph, takesPartsOfLargerImages) {
  cv::Mat large_labels(20, 30, CV_32SC1), large_gray(20, 30, CV_8UC1);
  cv::RNG random(5);
  random.fill(large_labels, cv::RNG::UNIFORM, 0, 6);
  random.fill(large_gray, cv::RNG::UNIFORM, 0, 256);
  const cv::Mat labels = large_labels(cv::Rect(3, 4, 11, 9)), gray = large_gray(cv::Rect(7, 2, 11, 9));
  SegmentGraph graph;
  graph.build(labels, gray, 6, 10.0);
  expectGraph(graph, 6, straightforward(labels.clone(), gray.clone(), 10.0));
}

}  // namespace
}  // namespace disparity_refinement
