#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <vector>

#include "SegmentationReference.hpp"
#include "disparity_refinement/segmentation/FilteredWatershed.hpp"

namespace disparity_refinement {
namespace {

using reference::BOTH_CONNECTIVITIES;
using reference::identical;
using reference::messageOf;
using reference::RandomImages;

using Gray = cv::Mat_<std::uint8_t>;
using Labels = cv::Mat_<int>;

/// The watershed of an image as it is, without filters.
class PlainWatershed {
 public:
  int compute(const cv::Mat& image, Connectivity connectivity, cv::Mat& labels) {
    image.copyTo(watershed_.image(image.size()));
    return watershed_.compute(0, 0, connectivity, labels);
  }

 private:
  FilteredWatershed watershed_;
};

cv::Mat labelsOf(const cv::Mat& image, Connectivity connectivity = Connectivity::FOUR) {
  cv::Mat labels;
  PlainWatershed().compute(image, connectivity, labels);
  return labels;
}

/// Calls check(image, connectivity, labels, count, reference) on 600 images, all through one object.
template <typename Check>
void forRandomImages(unsigned seed, Check check) {
  RandomImages images(seed);
  PlainWatershed watershed;
  cv::Mat labels;
  for (int i = 0; i < 600 && !testing::Test::HasFailure(); ++i) {
    const cv::Mat image = images.next();
    for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
      SCOPED_TRACE(testing::Message() << "connectivity " << static_cast<int>(connectivity) << ", image\n"
                                      << image);
      const int count = watershed.compute(image, connectivity, labels);
      check(image, connectivity, labels, count, reference::watershed(image, connectivity));
    }
  }
}

TEST(Watershed, equalsTheReference) {
  forRandomImages(
      1, [](const auto&, auto, const cv::Mat& labels, int count, const reference::Watershed& expected) {
        ASSERT_EQ(expected.count, count);
        ASSERT_TRUE(identical(expected.labels, labels)) << labels;
      });
}

TEST(Watershed, numbersTheRegionalMinimaInRasterOrder) {
  forRandomImages(2, [](const cv::Mat& image, auto, const cv::Mat& labels, int count,
                        const reference::Watershed& expected) {
    int next = 0;
    for (const cv::Point p : reference::pixelsOf(image)) {
      ASSERT_GE(labels.at<int>(p), 0);
      ASSERT_LT(labels.at<int>(p), count);
      if (expected.is_minimum.at<std::uint8_t>(p) == 0) continue;
      ASSERT_LE(labels.at<int>(p), next);
      if (labels.at<int>(p) == next) ++next;
    }
    ASSERT_EQ(count, next);
  });
}

TEST(Watershed, keepsTheLocalConditionAtEveryPixel) {
  forRandomImages(3, [](const cv::Mat& image, Connectivity connectivity, const cv::Mat& labels, int,
                        const reference::Watershed& expected) {
    for (const cv::Point p : reference::pixelsOf(image)) {
      if (expected.is_minimum.at<std::uint8_t>(p) != 0) continue;
      const std::vector<cv::Point> candidates = expected.candidates(image, p, connectivity);
      ASSERT_TRUE(std::any_of(candidates.begin(), candidates.end(), [&](cv::Point q) {
        return labels.at<int>(q) == labels.at<int>(p);
      })) << p;
      ASSERT_EQ(1U, expected.reachableFrom(p).count(labels.at<int>(p))) << p;
    }
  });
}

TEST(Watershed, givesConnectedBasins) {
  forRandomImages(4, [](const cv::Mat& image, Connectivity connectivity, const cv::Mat& labels, int count,
                        const reference::Watershed&) {
    std::set<int> seen;
    std::size_t pixels = 0;
    for (const cv::Point p : reference::pixelsOf(image)) {
      const int label = labels.at<int>(p);
      if (!seen.insert(label).second) continue;
      pixels += reference::connectedComponent(image, p, connectivity, [&](cv::Point q) {
                  return labels.at<int>(q) == label;
                }).size();
    }
    ASSERT_EQ(static_cast<std::size_t>(count), seen.size());
    ASSERT_EQ(image.total(), pixels);
  });
}

TEST(Watershed, dependsOnTheOrderOfTheValuesOnly) {
  forRandomImages(5, [](const cv::Mat& image, Connectivity connectivity, const cv::Mat& labels, int,
                        const reference::Watershed&) {
    // The values of the image as 0, 1, 2 ... and as ... 254, 255.
    const std::set<int> levels(image.begin<std::uint8_t>(), image.end<std::uint8_t>());
    cv::Mat ranks(image.size(), CV_8UC1), from_above(image.size(), CV_8UC1);
    for (const cv::Point p : reference::pixelsOf(image)) {
      const auto rank = std::distance(levels.begin(), levels.find(image.at<std::uint8_t>(p)));
      ranks.at<std::uint8_t>(p) = static_cast<std::uint8_t>(rank);
      from_above.at<std::uint8_t>(p) = static_cast<std::uint8_t>(256 - levels.size() + rank);
    }
    ASSERT_TRUE(identical(labels, labelsOf(ranks, connectivity)));
    ASSERT_TRUE(identical(labels, labelsOf(from_above, connectivity)));
  });
}

TEST(Watershed, differsInAMirrorOnlyWhereSeveralMinimaAreReachable) {
  int different = 0;
  forRandomImages(6, [&](const cv::Mat& image, Connectivity connectivity, const cv::Mat& labels, int count,
                         const reference::Watershed& expected) {
    for (const int axis : {0, 1, -1}) {
      cv::Mat mirrored, mirrored_labels;
      cv::flip(image, mirrored, axis);
      cv::flip(labelsOf(mirrored, connectivity), mirrored_labels, axis);
      std::vector<int> name(count, -1);  // Of a minimum in the mirror.
      for (const cv::Point p : reference::pixelsOf(image)) {
        if (expected.is_minimum.at<std::uint8_t>(p) != 0)
          name[labels.at<int>(p)] = mirrored_labels.at<int>(p);
      }
      for (const cv::Point p : reference::pixelsOf(image)) {
        if (name[labels.at<int>(p)] == mirrored_labels.at<int>(p)) continue;
        ++different;
        ASSERT_GT(expected.reachableFrom(p).size(), 1U) << p;
      }
    }
  });
  EXPECT_GT(different, 0);
}

TEST(Watershed, descendsToTheLowestNeighbour) {
  // The lower neighbours of the 5 are 4 (W), 2 (E), 3 (N), 3 (S).
  const cv::Mat image = (Gray(3, 3) << 9, 3, 9, 4, 5, 2, 9, 3, 9);
  for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
    const cv::Mat labels = labelsOf(image, connectivity);
    EXPECT_EQ(labels.at<int>(1, 2), labels.at<int>(1, 1));
  }
}

TEST(Watershed, breaksTiesInTheFixedOrder) {
  const cv::Point order[] = {{0, 1}, {2, 1}, {1, 0}, {1, 2}, {0, 0}, {2, 0}, {0, 2}, {2, 2}};
  for (int first = 0; first < 8; ++first) {
    for (int second = first + 1; second < 8; ++second) {
      // Two pits around a slope (2) and, one step farther away, around a plateau: the centre between two
      // exits.
      cv::Mat slope(3, 3, CV_8UC1, cv::Scalar(9));
      slope.at<std::uint8_t>(1, 1) = 2;
      slope.at<std::uint8_t>(order[first]) = 0;
      slope.at<std::uint8_t>(order[second]) = 0;
      const cv::Mat labels = labelsOf(slope, Connectivity::EIGHT);
      EXPECT_EQ(labels.at<int>(order[first]), labels.at<int>(1, 1)) << slope;

      cv::Mat plateau(5, 5, CV_8UC1, cv::Scalar(9));
      plateau.at<std::uint8_t>(2, 2) = 2;
      for (const int i : {first, second}) {
        const cv::Point step = order[i] - cv::Point(1, 1);
        plateau.at<std::uint8_t>(cv::Point(2, 2) + step) = 2;
        plateau.at<std::uint8_t>(cv::Point(2, 2) + 2 * step) = 0;
      }
      const cv::Mat plateau_labels = labelsOf(plateau, Connectivity::EIGHT);
      const cv::Point pit = cv::Point(2, 2) + 2 * (order[first] - cv::Point(1, 1));
      EXPECT_EQ(plateau_labels.at<int>(pit), plateau_labels.at<int>(2, 2)) << plateau;
    }
  }
}

TEST(Watershed, splitsAPlateauByTheDistanceToItsExits) {
  const cv::Mat even = (Gray(1, 8) << 0, 5, 5, 5, 5, 5, 5, 1);
  EXPECT_TRUE(identical((Labels(1, 8) << 0, 0, 0, 0, 1, 1, 1, 1), labelsOf(even)));
  // The pixel at equal distance goes west.
  const cv::Mat odd = (Gray(1, 7) << 0, 5, 5, 5, 5, 5, 1);
  EXPECT_TRUE(identical((Labels(1, 7) << 0, 0, 0, 0, 1, 1, 1), labelsOf(odd)));
}

TEST(Watershed, measuresTheDistanceInsideThePlateau) {
  // The right end of the lower row is near to the pit 0 as the crow flies, but the plateau is a detour.
  const cv::Mat image = (Gray(3, 7) << 0, 9, 9, 9, 9, 9, 9,  //
                         5, 5, 9, 5, 5, 5, 1,                //
                         9, 5, 5, 5, 9, 9, 9);
  const cv::Mat labels = labelsOf(image);
  EXPECT_EQ(0, labels.at<int>(2, 1));
  EXPECT_EQ(0, labels.at<int>(2, 2));
  EXPECT_EQ(1, labels.at<int>(2, 3));
  EXPECT_EQ(1, labels.at<int>(1, 3));
}

TEST(Watershed, drainsARingPlateauIntoItsPit) {
  cv::Mat image(7, 7, CV_8UC1, cv::Scalar(5));
  image.at<std::uint8_t>(3, 3) = 1;
  image.at<std::uint8_t>(0, 0) = 9;
  for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
    EXPECT_EQ(0, cv::countNonZero(labelsOf(image, connectivity)));
  }
}

TEST(Watershed, treatsThePlateauAtTheFrameLikeAnyOther) {
  // 255 on the outside, where a frame of 255 would join the plateau or leak into it.
  cv::Mat image(5, 6, CV_8UC1, cv::Scalar(255));
  image(cv::Rect(1, 1, 4, 3)).setTo(100);
  image(cv::Rect(2, 2, 1, 1)).setTo(0);
  image(cv::Rect(3, 2, 1, 1)).setTo(50);
  EXPECT_EQ(0, cv::countNonZero(labelsOf(image, Connectivity::FOUR)));

  const cv::Mat columns = (Gray(3, 5) << 0, 255, 255, 255, 1, 0, 255, 255, 255, 1, 0, 255, 255, 255, 1);
  const cv::Mat expected = (Labels(3, 5) << 0, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 1);
  for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
    EXPECT_TRUE(identical(expected, labelsOf(columns, connectivity)));
  }
}

TEST(Watershed, takesAFlatImageForOneMinimum) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(9, 1), cv::Size(1, 9), cv::Size(8, 5)}) {
    for (const int value : {0, 128, 255}) {
      const cv::Mat image(size, CV_8UC1, cv::Scalar(value));
      for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
        cv::Mat labels;
        EXPECT_EQ(1, PlainWatershed().compute(image, connectivity, labels));
        EXPECT_TRUE(identical(cv::Mat(size, CV_32SC1, cv::Scalar(0)), labels));
      }
    }
  }
}

TEST(Watershed, joinsDiagonalMinimaUnderConnectivityEightOnly) {
  const cv::Mat image = (Gray(2, 2) << 1, 9, 9, 1);
  EXPECT_TRUE(identical((Labels(2, 2) << 0, 0, 1, 1), labelsOf(image, Connectivity::FOUR)));
  EXPECT_TRUE(identical(cv::Mat(2, 2, CV_32SC1, cv::Scalar(0)), labelsOf(image, Connectivity::EIGHT)));
}

}  // namespace
}  // namespace disparity_refinement
