#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "SegmentationReference.hpp"
#include "disparity_refinement/segmentation/FilteredWatershed.hpp"
#include "disparity_refinement/segmentation/Gradient.hpp"
#include "straightforward/MinTree.hpp"
#include "straightforward/Watershed.hpp"

namespace disparity_refinement {
namespace {

using reference::BOTH_CONNECTIVITIES;
using reference::identical;
using reference::messageOf;
using reference::RandomImages;

using Row = cv::Mat_<std::uint8_t>;

/// The filters alone, through an object that may have worked on other images before.
class Filter {
 public:
  void build(const cv::Mat& image, Connectivity connectivity) {
    image.copyTo(watershed_.image(image.size()));
    connectivity_ = connectivity;
  }
  void filter(int lambda, int h, cv::Mat& output) {
    watershed_.compute(lambda, h, connectivity_, labels_);
    watershed_.filtered().copyTo(output);
  }
  int countSegments(int lambda, int h) { return watershed_.compute(lambda, h, connectivity_, labels_); }
  cv::Mat countSurface(int max_lambda, int max_h) {
    return watershed_.countSurface(max_lambda, max_h, connectivity_);
  }

 private:
  FilteredWatershed watershed_;
  Connectivity connectivity_ = Connectivity::FOUR;
  cv::Mat labels_;
};

cv::Mat filtered(const cv::Mat& image, int lambda, int h, Connectivity connectivity = Connectivity::FOUR) {
  Filter filter;
  filter.build(image, connectivity);
  cv::Mat output;
  filter.filter(lambda, h, output);
  return output;
}

std::vector<int> lambdasFor(const cv::Mat& image) {
  const int area = static_cast<int>(image.total());
  return {0, 1, 2, 3, 5, area - 1, area, area + 1};
}

/// Calls check(images, image, connectivity, filter) on 600 images under both connectivities, all through one
/// filter that was built for the image.
template <typename Check>
void forRandomImages(unsigned seed, Check check) {
  RandomImages images(seed);
  Filter filter;
  for (int i = 0; i < 600 && !testing::Test::HasFailure(); ++i) {
    const cv::Mat image = images.next();
    for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
      SCOPED_TRACE(testing::Message() << "connectivity " << static_cast<int>(connectivity) << ", image\n"
                                      << image);
      filter.build(image, connectivity);
      check(images, image, connectivity, filter);
    }
  }
}

TEST(FilteredWatershed, closesAreasLikeThresholdDecomposition) {
  forRandomImages(2, [](auto&, const cv::Mat& image, Connectivity connectivity, Filter& filter) {
    cv::Mat actual;
    for (const int lambda : lambdasFor(image)) {
      filter.filter(lambda, 0, actual);
      ASSERT_TRUE(identical(reference::areaClosing(image, lambda, connectivity), actual))
          << "lambda " << lambda;
    }
  });
}

TEST(FilteredWatershed, fillsMinimaLikeGeodesicErosion) {
  forRandomImages(3,
                  [](RandomImages& images, const cv::Mat& image, Connectivity connectivity, Filter& filter) {
                    cv::Mat actual;
                    for (const int h : {0, 1, images.uniform(2, 30), images.uniform(31, 254), 255}) {
                      filter.filter(0, h, actual);
                      ASSERT_TRUE(identical(reference::hMinima(image, h, connectivity), actual)) << "h " << h;
                    }
                  });
}

TEST(FilteredWatershed, filtersAndCountsLikeTheTwoOperatorsInTheirOrder) {
  RandomImages images(4);
  Filter filter;
  cv::Mat actual;
  for (int i = 0; i < 600; ++i) {
    const cv::Mat image = images.next();
    const std::vector<int> lambdas = lambdasFor(image);
    const Connectivity connectivity = BOTH_CONNECTIVITIES[i % 2];
    filter.build(image, connectivity);
    for (int k = 0; k < 6; ++k) {
      const int lambda = lambdas[images.uniform(0, static_cast<int>(lambdas.size()) - 1)];
      const int h = images.uniform(0, 3) == 0 ? images.uniform(0, 255) : images.uniform(0, 25);
      const cv::Mat expected =
          reference::hMinima(reference::areaClosing(image, lambda, connectivity), h, connectivity);
      filter.filter(lambda, h, actual);
      ASSERT_TRUE(identical(expected, actual)) << "lambda " << lambda << ", h " << h << " on\n" << image;
      ASSERT_EQ(reference::watershed(expected, connectivity).count, filter.countSegments(lambda, h))
          << "lambda " << lambda << ", h " << h << " on\n"
          << image;
    }
  }
}

TEST(FilteredWatershed, closesAreasBeforeItFillsMinima) {
  // The left basin is deep in one pixel only: closed first, it is too shallow for h. The other way round it
  // would stay at 7: its pixel of 0 would be filled up to 3 and closed then.
  const cv::Mat image = (Row(1, 10) << 9, 7, 7, 0, 7, 9, 1, 1, 1, 9);
  const cv::Mat closing_first = (Row(1, 10) << 9, 9, 9, 9, 9, 9, 4, 4, 4, 9);
  const cv::Mat minima_first = (Row(1, 10) << 9, 7, 7, 7, 7, 9, 4, 4, 4, 9);
  EXPECT_TRUE(identical(closing_first, filtered(image, 3, 3)));
  EXPECT_TRUE(identical(minima_first, filtered(filtered(image, 0, 3), 3, 0)));

  Filter filter;
  filter.build(image, Connectivity::FOUR);
  EXPECT_EQ(1, filter.countSegments(3, 3));
}

TEST(FilteredWatershed, keepsTheImageAtTheLeastParameters) {
  RandomImages images(5);
  for (int i = 0; i < 100; ++i) {
    const cv::Mat image = images.next();
    EXPECT_TRUE(identical(image, filtered(image, 0, 0)));
    EXPECT_TRUE(identical(image, filtered(image, 1, 0)));
  }
}

TEST(FilteredWatershed, countsTheDepthOfAMinimumUpToItsPass) {
  // The pit of 3 has a pass at 8, the pit of 0 is the lowest of all.
  const cv::Mat image = (Row(1, 3) << 0, 8, 3);
  EXPECT_TRUE(identical((Row(1, 3) << 4, 8, 7), filtered(image, 0, 4)));
  EXPECT_TRUE(identical((Row(1, 3) << 5, 8, 8), filtered(image, 0, 5)));
  EXPECT_TRUE(identical((Row(1, 3) << 9, 9, 9), filtered(image, 0, 9)));
}

TEST(FilteredWatershed, joinsDiagonalNeighboursUnderConnectivityEightOnly) {
  const cv::Mat image = (Row(2, 2) << 1, 9, 9, 1);
  EXPECT_TRUE(identical(cv::Mat(2, 2, CV_8UC1, cv::Scalar(9)), filtered(image, 2, 0, Connectivity::FOUR)));
  EXPECT_TRUE(identical(image, filtered(image, 2, 0, Connectivity::EIGHT)));
}

TEST(FilteredWatershed, saturatesAt255WithoutJoiningSegments) {
  EXPECT_TRUE(identical((Row(1, 3) << 255, 255, 255), filtered((Row(1, 3) << 255, 255, 255), 0, 255)));
  EXPECT_TRUE(identical((Row(1, 3) << 255, 255, 255), filtered((Row(1, 3) << 250, 255, 252), 0, 6)));
  // 252 + 2 is one below the pass.
  EXPECT_TRUE(identical((Row(1, 3) << 252, 255, 254), filtered((Row(1, 3) << 250, 255, 252), 0, 2)));
  // 252 + 3 reaches it.
  EXPECT_TRUE(identical((Row(1, 3) << 253, 255, 255), filtered((Row(1, 3) << 250, 255, 252), 0, 3)));

  Filter filter;
  filter.build((Row(1, 3) << 250, 255, 252), Connectivity::FOUR);
  EXPECT_EQ(2, filter.countSegments(0, 2));
  for (const int h : {3, 5, 6, 255}) EXPECT_EQ(1, filter.countSegments(0, h)) << "h " << h;
}

TEST(FilteredWatershed, countsTheSameInTheSurface) {
  RandomImages images(6);
  Filter filter;
  for (int i = 0; i < 60; ++i) {
    const cv::Mat image = images.next();
    filter.build(image, BOTH_CONNECTIVITIES[i % 2]);
    const int max_lambda = static_cast<int>(image.total()) + 1;
    const int max_h = i % 3 == 0 ? 255 : images.uniform(0, 40);
    const cv::Mat surface = filter.countSurface(max_lambda, max_h);
    ASSERT_EQ(cv::Size(max_h + 1, max_lambda + 1), surface.size());
    ASSERT_EQ(CV_32SC1, surface.type());
    for (int lambda = 0; lambda <= max_lambda; ++lambda) {
      for (int h = 0; h <= max_h; ++h) {
        const int count = surface.at<int>(lambda, h);
        ASSERT_EQ(filter.countSegments(lambda, h), count) << "lambda " << lambda << ", h " << h << " on\n"
                                                          << image;
        ASSERT_GE(count, 1);
        ASSERT_GE(surface.at<int>(std::max(lambda - 1, 0), h), count);
        ASSERT_GE(surface.at<int>(lambda, std::max(h - 1, 0)), count);
      }
    }
  }
}

TEST(FilteredWatershed, keepsNothingOfFormerImages) {
  RandomImages images(7);
  Filter reused;
  cv::Mat from_reused;
  for (int i = 0; i < 300; ++i) {
    const cv::Mat image = images.next();
    const Connectivity connectivity = BOTH_CONNECTIVITIES[images.uniform(0, 1)];
    reused.build(image, connectivity);
    reused.filter(4, 3, from_reused);
    ASSERT_TRUE(identical(filtered(image, 4, 3, connectivity), from_reused)) << image;
  }
}

TEST(FilteredWatershed, fillsLabelsThatArePartsOfLargerOnes) {
  RandomImages images(8);
  for (int i = 0; i < 50; ++i) {
    const cv::Mat image = images.next();
    FilteredWatershed watershed;
    image.copyTo(watershed.image(image.size()));
    cv::Mat expected;
    watershed.compute(3, 2, Connectivity::EIGHT, expected);
    cv::Mat larger(image.rows + 2, image.cols + 3, CV_32SC1, cv::Scalar(-77));
    cv::Mat labels = larger(cv::Rect(1, 1, image.cols, image.rows));
    const std::uint8_t* data = labels.data;
    watershed.compute(3, 2, Connectivity::EIGHT, labels);
    EXPECT_EQ(data, labels.data);
    EXPECT_TRUE(identical(expected, labels));
    labels.setTo(-77);
    EXPECT_EQ(0, cv::countNonZero(larger != -77)) << "written outside the labels";
  }
}

TEST(FilteredWatershed, refusesOtherArguments) {
  const auto message = [](auto call) { return messageOf<std::invalid_argument>(call); };
  FilteredWatershed watershed;
  cv::Mat labels;
  const auto compute = [&](int lambda, int h, int connectivity = 4) {
    return message([&] { watershed.compute(lambda, h, static_cast<Connectivity>(connectivity), labels); });
  };
  EXPECT_EQ("image is empty, expected image(size) to be called and filled first", compute(0, 0));
  EXPECT_EQ("width of the image is 0, expected at least 1", message([&] { watershed.image({0, 3}); }));
  watershed.image({3, 2}).setTo(1);
  EXPECT_EQ("connectivity is 6, expected 4 or 8", compute(0, 0, 6));
  EXPECT_EQ("lambda is -1, expected at least 0", compute(-1, 0));
  EXPECT_EQ("h is -1, expected 0...255", compute(0, -1));
  EXPECT_EQ("h is 256, expected 0...255", compute(0, 256));
  EXPECT_EQ("", compute(0, 0));

  const auto surface = [&](int max_lambda, int max_h) {
    return message([&] { watershed.countSurface(max_lambda, max_h, Connectivity::FOUR); });
  };
  EXPECT_EQ("max_lambda is -1, expected 0...1000", surface(-1, 0));
  EXPECT_EQ("max_h is -1, expected 0...255", surface(0, -1));
  EXPECT_EQ("max_h is 256, expected 0...255", surface(0, 256));

  EXPECT_EQ("strips is 0, expected 1...64", message([] { FilteredWatershed(0); }));
  EXPECT_EQ("strips is 65, expected 1...64", message([] { FilteredWatershed(65); }));
  EXPECT_NE("", message([&] { watershed.image({50000, 50000}); })) << "beyond 32-bit indices";
}

TEST(FilteredWatershed, isIndependentOfItsCopy) {
  FilteredWatershed one;
  const cv::Mat minima = (Row(1, 5) << 1, 9, 1, 9, 1), flat = (Row(1, 5) << 1, 1, 1, 1, 1);
  minima.copyTo(one.image(minima.size()));
  FilteredWatershed other = one;
  flat.copyTo(one.image(flat.size()));
  cv::Mat labels;
  EXPECT_EQ(3, other.compute(0, 0, Connectivity::FOUR, labels));
  EXPECT_EQ(1, one.compute(0, 0, Connectivity::FOUR, labels));
}

/// Compares everything with the straightforward chain: a min-tree of the pixels, and a watershed of the
/// filtered image.
class Comparison {
 public:
  explicit Comparison(int strips = 1) : watershed_(strips) {}

  testing::AssertionResult equal(const cv::Mat& image, int lambda, int h, Connectivity connectivity) {
    image.copyTo(watershed_.image(image.size()));
    const int count = watershed_.compute(lambda, h, connectivity, labels_);
    tree_.build(image, connectivity);
    tree_.filter(lambda, h, filtered_);
    const int expected = expected_watershed_.compute(filtered_, connectivity, expected_labels_);
    const bool is_equal = count == expected && identical(filtered_, watershed_.filtered()) &&
                          identical(expected_labels_, labels_);
    if (is_equal) return testing::AssertionSuccess();
    testing::AssertionResult failure = testing::AssertionFailure();
    failure << image.cols << "x" << image.rows << ", lambda " << lambda << ", h " << h << ", connectivity "
            << static_cast<int>(connectivity) << ": " << count << " segments, expected " << expected;
    if (image.total() < 200) failure << "\n" << image;
    return failure;
  }

 private:
  FilteredWatershed watershed_;
  straightforward::MinTree tree_;
  straightforward::Watershed expected_watershed_;
  cv::Mat labels_, filtered_, expected_labels_;
};

int randomLambda(RandomImages& images, const cv::Mat& image) {
  const int area = static_cast<int>(image.total());
  const int choices[] = {
      0, 1, images.uniform(2, 9), images.uniform(2, 60), images.uniform(1, area), area, area + 1, 1000000};
  return choices[images.uniform(0, 7)];
}

int randomH(RandomImages& images) {
  const int choices[] = {0, 1, images.uniform(2, 12), images.uniform(2, 60), images.uniform(0, 255), 255};
  return choices[images.uniform(0, 5)];
}

/// Smooth structure under noise, of any size up to 90x60.
cv::Mat randomScene(RandomImages& images) {
  cv::Mat noise(images.uniform(1, 60), images.uniform(1, 90), CV_8UC1), smooth;
  cv::RNG random(static_cast<std::uint64_t>(images.uniform(0, 1 << 30)));
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(noise, smooth, {}, 1.0 + images.uniform(0, 3));
  cv::normalize(smooth, smooth, images.uniform(0, 200), 255, cv::NORM_MINMAX);
  return smooth;
}

TEST(FilteredWatershed, equalsTheStraightforwardChainOnRandomImages) {
  RandomImages images(20);
  std::vector<std::unique_ptr<Comparison>> comparisons;
  for (const int strips : {1, 2, 3, 7, 64}) comparisons.push_back(std::make_unique<Comparison>(strips));
  for (int i = 0; i < 40000; ++i) {
    const cv::Mat image = i % 20 == 0 ? randomScene(images) : images.next();
    ASSERT_TRUE(comparisons[i / 2 % comparisons.size()]->equal(image, randomLambda(images, image),
                                                               randomH(images), BOTH_CONNECTIVITIES[i % 2]));
  }
}

TEST(FilteredWatershed, countsTheSameSurfaceAsTheStraightforwardTree) {
  RandomImages images(21);
  FilteredWatershed watershed;
  straightforward::MinTree tree;
  for (int i = 0; i < 1000; ++i) {
    const cv::Mat image = i % 20 == 0 ? randomScene(images) : images.next();
    const Connectivity connectivity = BOTH_CONNECTIVITIES[i % 2];
    image.copyTo(watershed.image(image.size()));
    tree.build(image, connectivity);
    const int max_lambda = images.uniform(0, static_cast<int>(std::min<std::size_t>(image.total(), 300)) + 2);
    const int max_h = images.uniform(0, 255);
    ASSERT_TRUE(identical(tree.countSurface(max_lambda, max_h),
                          watershed.countSurface(max_lambda, max_h, connectivity)))
        << max_lambda << ", " << max_h << " on\n"
        << image;
  }
}

TEST(FilteredWatershed, equalsTheStraightforwardChainOnFlatImagesAndLines) {
  RandomImages images(22);
  for (const int strips : {1, 5}) {
    Comparison comparison(strips);
    for (const cv::Size size :
         {cv::Size(1, 1), cv::Size(100000, 1), cv::Size(1, 100000), cv::Size(317, 203)}) {
      for (const int level : {0, 1, 100, 254, 255}) {
        const cv::Mat flat(size, CV_8UC1, cv::Scalar(level));
        for (const int lambda : {0, 30, 1000000}) {
          for (const int h : {0, 5, 255}) {
            ASSERT_TRUE(comparison.equal(flat, lambda, h, BOTH_CONNECTIVITIES[(lambda + h) % 2]));
          }
        }
      }
      cv::Mat noise(size, CV_8UC1);
      cv::RNG(7).fill(noise, cv::RNG::UNIFORM, 0, 256);
      for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
        ASSERT_TRUE(comparison.equal(noise, 3, 20, connectivity));
      }
    }
  }
}

TEST(FilteredWatershed, equalsTheStraightforwardChainOnALongCorridor) {
  // A flat corridor one pixel wide, to and fro between walls: the path to its only exit has half as many
  // pixels as the image.
  cv::Mat corridor(301, 400, CV_8UC1, cv::Scalar(9));
  for (int y = 0; y < corridor.rows; y += 2) {
    if (y > 0) corridor.at<std::uint8_t>(y - 1, y % 4 == 0 ? 0 : corridor.cols - 1) = 5;
    corridor.row(y).setTo(5);
  }
  for (const bool exit_is_above : {true, false}) {
    cv::Mat image = corridor.clone();
    image.at<std::uint8_t>(exit_is_above ? 0 : image.rows - 1, 200) = 1;
    for (const int strips : {1, 6}) {
      for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
        ASSERT_TRUE(Comparison(strips).equal(image, 0, 0, connectivity));
        ASSERT_TRUE(Comparison(strips).equal(255 - image, 0, 2, connectivity));
      }
    }
  }
}

TEST(FilteredWatershed, equalsTheStraightforwardChainBeyond65536Basins) {
  for (const int strips : {1, 2}) {
    Comparison comparison(strips);
    cv::Mat noise(900, 1100, CV_8UC1);
    cv::RNG(8).fill(noise, cv::RNG::UNIFORM, 0, 256);
    for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
      // Nothing is filtered: every basin that is a regional minimum stays.
      ASSERT_TRUE(comparison.equal(noise, 0, 0, connectivity));
      ASSERT_TRUE(comparison.equal(noise, 12, 40, connectivity));
    }
    // One pixel in four is a minimum.
    for (int y = 0; y < noise.rows; ++y) {
      for (int x = 0; x < noise.cols; ++x) {
        if (x % 2 == 0 || y % 2 == 0) noise.at<std::uint8_t>(y, x) = 255;
      }
    }
    ASSERT_TRUE(comparison.equal(noise, 0, 0, Connectivity::EIGHT));
    ASSERT_TRUE(comparison.equal(noise, 0, 200, Connectivity::FOUR));
  }
}

TEST(FilteredWatershed, equalsTheStraightforwardChainBeyond16MillionPixels) {
  cv::Mat noise(4101, 4099, CV_8UC1);
  ASSERT_GT(noise.total(), 1U << 24);
  cv::RNG(9).fill(noise, cv::RNG::UNIFORM, 0, 256);
  ASSERT_TRUE(Comparison(2).equal(noise, 30, 20, Connectivity::EIGHT));
}

TEST(FilteredWatershed, equalsTheStraightforwardChainOnKittiFrames) {
  const char* folder = std::getenv("DISPARITY_REFINEMENT_KITTI");
  if (folder == nullptr) {
    std::cout << "DISPARITY_REFINEMENT_KITTI is not set: no KITTI frame looked at\n";
    return;
  }
  std::vector<cv::String> files;
  cv::glob(std::string(folder) + "/image_0/*.png", files);
  ASSERT_FALSE(files.empty());
  Comparison one_strip(1), four_strips(4);
  Gradient gradient;
  cv::Mat image;
  for (std::size_t i = 0; i < files.size(); ++i) {
    gradient.compute(cv::imread(files[i], cv::IMREAD_GRAYSCALE), {}, image);
    Comparison& comparison = i % 2 == 0 ? one_strip : four_strips;
    for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
      ASSERT_TRUE(comparison.equal(image, 30, 5, connectivity)) << files[i];
      ASSERT_TRUE(comparison.equal(image, i % 4 < 2 ? 5 : 80, i % 4 < 2 ? 2 : 15, connectivity)) << files[i];
    }
  }
}

}  // namespace
}  // namespace disparity_refinement
