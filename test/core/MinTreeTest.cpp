#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <vector>

#include "SegmentationReference.hpp"
#include "disparity_refinement/segmentation/MinTree.hpp"

namespace disparity_refinement {
namespace {

using reference::BOTH_CONNECTIVITIES;
using reference::identical;
using reference::messageOf;
using reference::RandomImages;

using Row = cv::Mat_<std::uint8_t>;

cv::Mat filtered(const cv::Mat& image, int lambda, int h, Connectivity connectivity = Connectivity::FOUR) {
  MinTree tree;
  tree.build(image, connectivity);
  cv::Mat output;
  tree.filter(lambda, h, output);
  return output;
}

std::vector<int> lambdasFor(const cv::Mat& image) {
  const int area = static_cast<int>(image.total());
  return {0, 1, 2, 3, 5, area - 1, area, area + 1};
}

TEST(MinTree, hasANodeForEveryComponentWithAPixelOfItsLevel) {
  // Two pits below 5, a plateau of 5, a rim of 9.
  const cv::Mat image = (Row(1, 7) << 1, 5, 3, 9, 9, 1, 9);
  MinTree tree;
  tree.build(image, Connectivity::FOUR);
  ASSERT_EQ(5U, tree.nodes().size());
  std::multiset<std::vector<int>> level_area_parent;
  for (const MinTree::Node& node : tree.nodes()) {
    level_area_parent.insert({node.level, node.area, tree.nodes()[node.parent].level});
  }
  const std::multiset<std::vector<int>> expected = {{1, 1, 5}, {3, 1, 5}, {5, 3, 9}, {1, 1, 9}, {9, 7, 9}};
  EXPECT_EQ(expected, level_area_parent);
}

TEST(MinTree, listsChildrenBeforeParentsAndTheRootLast) {
  RandomImages images(1);
  MinTree tree;
  for (int i = 0; i < 300; ++i) {
    const cv::Mat image = images.next();
    for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
      tree.build(image, connectivity);
      const std::vector<MinTree::Node>& nodes = tree.nodes();
      const int root = static_cast<int>(nodes.size()) - 1;
      ASSERT_EQ(root, nodes[root].parent);
      ASSERT_EQ(static_cast<int>(image.total()), nodes[root].area);
      for (int n = 0; n < root; ++n) {
        ASSERT_LT(n, nodes[n].parent);
        ASSERT_LT(nodes[n].level, nodes[nodes[n].parent].level);
        ASSERT_LT(nodes[n].area, nodes[nodes[n].parent].area);
      }

      // Every pixel stands for the component of {f <= f(p)} that holds it; its first pixel names it.
      std::multiset<std::pair<int, int>> expected;
      std::set<std::pair<int, int>> seen;
      for (const cv::Point p : reference::pixelsOf(image)) {
        const int level = image.at<std::uint8_t>(p);
        const std::vector<cv::Point> component = reference::lowerComponent(image, level, p, connectivity);
        int first = p.y * image.cols + p.x;
        for (const cv::Point q : component) first = std::min(first, q.y * image.cols + q.x);
        if (seen.insert({level, first}).second) expected.insert({level, static_cast<int>(component.size())});
      }
      std::multiset<std::pair<int, int>> actual;
      for (const MinTree::Node& node : nodes) actual.insert({node.level, node.area});
      ASSERT_EQ(expected, actual) << image;
    }
  }
}

TEST(MinTree, closesAreasLikeThresholdDecomposition) {
  RandomImages images(2);
  MinTree tree;
  cv::Mat actual;
  for (int i = 0; i < 600; ++i) {
    const cv::Mat image = images.next();
    for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
      tree.build(image, connectivity);
      for (const int lambda : lambdasFor(image)) {
        tree.filter(lambda, 0, actual);
        ASSERT_TRUE(identical(reference::areaClosing(image, lambda, connectivity), actual))
            << "lambda " << lambda << " on\n"
            << image;
      }
    }
  }
}

TEST(MinTree, fillsMinimaLikeGeodesicErosion) {
  RandomImages images(3);
  MinTree tree;
  cv::Mat actual;
  for (int i = 0; i < 600; ++i) {
    const cv::Mat image = images.next();
    for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
      tree.build(image, connectivity);
      for (const int h : {0, 1, images.uniform(2, 30), images.uniform(31, 254), 255}) {
        tree.filter(0, h, actual);
        ASSERT_TRUE(identical(reference::hMinima(image, h, connectivity), actual)) << "h " << h << " on\n"
                                                                                   << image;
      }
    }
  }
}

TEST(MinTree, filtersAndCountsLikeTheTwoOperatorsInTheirOrder) {
  RandomImages images(4);
  MinTree tree;
  cv::Mat actual;
  for (int i = 0; i < 600; ++i) {
    const cv::Mat image = images.next();
    const std::vector<int> lambdas = lambdasFor(image);
    const Connectivity connectivity = BOTH_CONNECTIVITIES[i % 2];
    tree.build(image, connectivity);
    for (int k = 0; k < 6; ++k) {
      const int lambda = lambdas[images.uniform(0, static_cast<int>(lambdas.size()) - 1)];
      const int h = images.uniform(0, 3) == 0 ? images.uniform(0, 255) : images.uniform(0, 25);
      const cv::Mat expected =
          reference::hMinima(reference::areaClosing(image, lambda, connectivity), h, connectivity);
      tree.filter(lambda, h, actual);
      ASSERT_TRUE(identical(expected, actual)) << "lambda " << lambda << ", h " << h << " on\n" << image;
      ASSERT_EQ(reference::watershed(expected, connectivity).count, tree.countSegments(lambda, h))
          << "lambda " << lambda << ", h " << h << " on\n"
          << image;
    }
  }
}

TEST(MinTree, closesAreasBeforeItFillsMinima) {
  // The left basin is deep in one pixel only: closed first, it is too shallow for h. The other way round it
  // would stay at 7: its pixel of 0 would be filled up to 3 and closed then.
  const cv::Mat image = (Row(1, 10) << 9, 7, 7, 0, 7, 9, 1, 1, 1, 9);
  const cv::Mat closing_first = (Row(1, 10) << 9, 9, 9, 9, 9, 9, 4, 4, 4, 9);
  const cv::Mat minima_first = (Row(1, 10) << 9, 7, 7, 7, 7, 9, 4, 4, 4, 9);
  EXPECT_TRUE(identical(closing_first, filtered(image, 3, 3)));
  EXPECT_TRUE(identical(minima_first, filtered(filtered(image, 0, 3), 3, 0)));

  MinTree tree;
  tree.build(image, Connectivity::FOUR);
  EXPECT_EQ(1, tree.countSegments(3, 3));
}

TEST(MinTree, keepsTheImageAtTheLeastParameters) {
  RandomImages images(5);
  for (int i = 0; i < 100; ++i) {
    const cv::Mat image = images.next();
    EXPECT_TRUE(identical(image, filtered(image, 0, 0)));
    EXPECT_TRUE(identical(image, filtered(image, 1, 0)));
  }
}

TEST(MinTree, countsTheDepthOfAMinimumUpToItsPass) {
  // The pit of 3 has a pass at 8, the pit of 0 is the lowest of all.
  const cv::Mat image = (Row(1, 3) << 0, 8, 3);
  EXPECT_TRUE(identical((Row(1, 3) << 4, 8, 7), filtered(image, 0, 4)));
  EXPECT_TRUE(identical((Row(1, 3) << 5, 8, 8), filtered(image, 0, 5)));
  EXPECT_TRUE(identical((Row(1, 3) << 9, 9, 9), filtered(image, 0, 9)));
}

TEST(MinTree, joinsDiagonalNeighboursUnderConnectivityEightOnly) {
  const cv::Mat image = (Row(2, 2) << 1, 9, 9, 1);
  EXPECT_TRUE(identical(cv::Mat(2, 2, CV_8UC1, cv::Scalar(9)), filtered(image, 2, 0, Connectivity::FOUR)));
  EXPECT_TRUE(identical(image, filtered(image, 2, 0, Connectivity::EIGHT)));
}

TEST(MinTree, saturatesAt255WithoutJoiningSegments) {
  EXPECT_TRUE(identical((Row(1, 3) << 255, 255, 255), filtered((Row(1, 3) << 255, 255, 255), 0, 255)));
  EXPECT_TRUE(identical((Row(1, 3) << 255, 255, 255), filtered((Row(1, 3) << 250, 255, 252), 0, 6)));
  // 252 + 2 is one below the pass.
  EXPECT_TRUE(identical((Row(1, 3) << 252, 255, 254), filtered((Row(1, 3) << 250, 255, 252), 0, 2)));
  // 252 + 3 reaches it.
  EXPECT_TRUE(identical((Row(1, 3) << 253, 255, 255), filtered((Row(1, 3) << 250, 255, 252), 0, 3)));

  MinTree tree;
  tree.build((Row(1, 3) << 250, 255, 252), Connectivity::FOUR);
  EXPECT_EQ(2, tree.countSegments(0, 2));
  for (const int h : {3, 5, 6, 255}) EXPECT_EQ(1, tree.countSegments(0, h)) << "h " << h;
}

TEST(MinTree, countsTheSameInTheSurface) {
  RandomImages images(6);
  MinTree tree;
  for (int i = 0; i < 60; ++i) {
    const cv::Mat image = images.next();
    tree.build(image, BOTH_CONNECTIVITIES[i % 2]);
    const int max_lambda = static_cast<int>(image.total()) + 1;
    const int max_h = i % 3 == 0 ? 255 : images.uniform(0, 40);
    const cv::Mat surface = tree.countSurface(max_lambda, max_h);
    ASSERT_EQ(cv::Size(max_h + 1, max_lambda + 1), surface.size());
    ASSERT_EQ(CV_32SC1, surface.type());
    for (int lambda = 0; lambda <= max_lambda; ++lambda) {
      for (int h = 0; h <= max_h; ++h) {
        const int count = surface.at<int>(lambda, h);
        ASSERT_EQ(tree.countSegments(lambda, h), count) << "lambda " << lambda << ", h " << h << " on\n"
                                                        << image;
        ASSERT_GE(count, 1);
        ASSERT_GE(surface.at<int>(std::max(lambda - 1, 0), h), count);
        ASSERT_GE(surface.at<int>(lambda, std::max(h - 1, 0)), count);
      }
    }
  }
}

TEST(MinTree, keepsNothingOfFormerImages) {
  RandomImages images(7);
  MinTree reused;
  cv::Mat from_reused;
  for (int i = 0; i < 300; ++i) {
    const cv::Mat image = images.next();
    const Connectivity connectivity = BOTH_CONNECTIVITIES[images.uniform(0, 1)];
    reused.build(image, connectivity);
    reused.filter(4, 3, from_reused);
    ASSERT_TRUE(identical(filtered(image, 4, 3, connectivity), from_reused)) << image;
  }
}

TEST(MinTree, takesAndFillsPartsOfLargerImages) {
  RandomImages images(8);
  for (int i = 0; i < 50; ++i) {
    const cv::Mat image = images.next();
    MinTree tree;
    tree.build(reference::insideLarger(image, 0), Connectivity::EIGHT);
    cv::Mat larger(image.rows + 2, image.cols + 3, CV_8UC1, cv::Scalar(77));
    cv::Mat output = larger(cv::Rect(1, 1, image.cols, image.rows));
    const std::uint8_t* data = output.data;
    tree.filter(3, 2, output);
    EXPECT_EQ(data, output.data);
    EXPECT_TRUE(identical(filtered(image, 3, 2, Connectivity::EIGHT), output));
    output.setTo(77);
    EXPECT_EQ(0, cv::countNonZero(larger != 77)) << "written outside the output";
  }
}

TEST(MinTree, refusesOtherArguments) {
  MinTree tree;
  const auto message = [](auto call) { return messageOf<std::invalid_argument>(call); };
  cv::Mat output;
  EXPECT_NE("", message([&] { tree.filter(0, 0, output); })) << "no tree yet";
  EXPECT_NE("", message([&] { tree.countSegments(0, 0); })) << "no tree yet";
  EXPECT_NE("", message([&] { tree.countSurface(0, 0); })) << "no tree yet";
  EXPECT_NE("", message([&] { tree.build(cv::Mat(), Connectivity::FOUR); }));
  EXPECT_NE("", message([&] { tree.build(cv::Mat(2, 2, CV_8UC3), Connectivity::FOUR); }));
  const cv::Mat image(2, 3, CV_8UC1, cv::Scalar(1));
  EXPECT_EQ("connectivity is 6, expected 4 or 8",
            message([&] { tree.build(image, static_cast<Connectivity>(6)); }));

  tree.build(image, Connectivity::FOUR);
  EXPECT_EQ("lambda is -1, expected at least 0", message([&] { tree.filter(-1, 0, output); }));
  EXPECT_EQ("h is -1, expected 0...255", message([&] { tree.filter(0, -1, output); }));
  EXPECT_EQ("h is 256, expected 0...255", message([&] { tree.filter(0, 256, output); }));
  EXPECT_EQ("lambda is -1, expected at least 0", message([&] { tree.countSegments(-1, 0); }));
  EXPECT_EQ("h is 256, expected 0...255", message([&] { tree.countSegments(0, 256); }));
  EXPECT_EQ("max_lambda is -1, expected at least 0", message([&] { tree.countSurface(-1, 0); }));
  EXPECT_EQ("max_h is -1, expected 0...255", message([&] { tree.countSurface(0, -1); }));
  EXPECT_EQ("max_h is 256, expected 0...255", message([&] { tree.countSurface(0, 256); }));
}

TEST(MinTree, refusesImagesBeyond32BitIndices) {
  std::uint8_t pixel = 0;
  const cv::Mat header_only(50000, 50000, CV_8UC1, &pixel);
  EXPECT_NE("", messageOf<std::invalid_argument>([&] { MinTree().build(header_only, Connectivity::FOUR); }));
}

}  // namespace
}  // namespace disparity_refinement
