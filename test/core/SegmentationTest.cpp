#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>

#include "SegmentationReference.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {
namespace {

using reference::BOTH_CONNECTIVITIES;
using reference::identical;
using reference::messageOf;
using reference::RandomImages;

SegmentationParameters randomParameters(RandomImages& images) {
  SegmentationParameters parameters;
  parameters.lambda = images.uniform(0, 12);
  parameters.h = images.uniform(0, 40);
  parameters.connectivity = BOTH_CONNECTIVITIES[images.uniform(0, 1)];
  parameters.gradient.structuring_element = static_cast<StructuringElement>(images.uniform(0, 1));
  parameters.gradient.shadow_enhancement = images.uniform(0, 1) == 1;
  return parameters;
}

TEST(Segmentation, runsItsStagesInTheirOrder) {
  RandomImages images(1);
  Segmentation segmentation;
  cv::Mat labels, gradient;
  for (int i = 0; i < 600; ++i) {
    const cv::Mat gray = images.next();
    const cv::Mat before = gray.clone();
    const SegmentationParameters parameters = randomParameters(images);
    const int count = segmentation.compute(gray, parameters, labels);
    ASSERT_TRUE(identical(before, gray));

    Gradient().compute(gray, parameters.gradient, gradient);
    const Connectivity connectivity = parameters.connectivity;
    const cv::Mat closed = reference::areaClosing(gradient, parameters.lambda, connectivity);
    const cv::Mat filtered = reference::hMinima(closed, parameters.h, connectivity);
    const reference::Watershed expected = reference::watershed(filtered, connectivity);
    ASSERT_TRUE(identical(gradient, segmentation.gradient())) << gray;
    ASSERT_TRUE(identical(filtered, segmentation.filtered())) << gray;
    ASSERT_TRUE(identical(expected.labels, labels)) << gray;
    ASSERT_EQ(expected.count, count) << gray;
  }
}

TEST(Segmentation, keepsNothingOfFormerFrames) {
  RandomImages images(2);
  Segmentation reused;
  for (int i = 0; i < 300; ++i) {
    const cv::Mat gray = images.next();
    const SegmentationParameters parameters = randomParameters(images);
    cv::Mat from_reused, from_fresh;
    const int count = reused.compute(gray, parameters, from_reused);
    ASSERT_EQ(Segmentation().compute(gray, parameters, from_fresh), count);
    ASSERT_TRUE(identical(from_fresh, from_reused)) << gray;
  }
}

TEST(Segmentation, writesIntoLabelsOfTheRightSize) {
  RandomImages images(3);
  for (int i = 0; i < 50; ++i) {
    const cv::Mat gray = images.next();
    cv::Mat expected;
    Segmentation().compute(gray, {}, expected);
    cv::Mat larger(gray.rows + 1, gray.cols + 3, CV_32SC1, cv::Scalar(-7));
    cv::Mat labels = larger(cv::Rect(2, 1, gray.cols, gray.rows));
    const std::uint8_t* data = labels.data;
    Segmentation().compute(reference::insideLarger(gray, 255), {}, labels);
    EXPECT_EQ(data, labels.data);
    EXPECT_TRUE(identical(expected, labels));
  }
}

TEST(Segmentation, takesALargeImage) {
  const cv::Size size(4096, 3000);
  Segmentation segmentation;
  SegmentationParameters parameters;
  parameters.lambda = 0;
  parameters.h = 0;
  parameters.gradient.shadow_enhancement = false;
  cv::Mat labels;

  EXPECT_EQ(1, segmentation.compute(cv::Mat(size, CV_8UC1, cv::Scalar(255)), parameters, labels));

  // A checkerboard of fields of 4x4 pixels: the gradient is 0 on the 2x2 pixels inside a field, and 255
  // around them.
  cv::Mat board(size, CV_8UC1);
  for (int y = 0; y < board.rows; ++y) {
    auto* row = board.ptr<std::uint8_t>(y);
    for (int x = 0; x < board.cols; ++x) row[x] = (x / 4 + y / 4) % 2 == 0 ? 0 : 255;
  }
  EXPECT_EQ(1024 * 750, segmentation.compute(board, parameters, labels));
  EXPECT_EQ(1024 * 750 - 1, labels.at<int>(size.height - 1, size.width - 1));
  // At the corners of the image a field has 3x3 pixels inside.
  parameters.lambda = 9;
  EXPECT_EQ(4, segmentation.compute(board, parameters, labels));
  parameters.lambda = 10;
  EXPECT_EQ(1, segmentation.compute(board, parameters, labels));
}

TEST(Segmentation, surfaceHasTheCountsOfTheWatershedAtEveryPoint) {
  RandomImages images(8);
  Segmentation segmentation;
  cv::Mat labels;
  for (int i = 0; i < 40; ++i) {
    const cv::Mat gray = images.next();
    SegmentationParameters parameters = randomParameters(images);
    segmentation.compute(gray, parameters, labels);
    const int max_lambda = static_cast<int>(gray.total()) + 1, max_h = i % 4 == 0 ? 255 : 60;
    const cv::Mat surface = segmentation.countSurface(gray, parameters, max_lambda, max_h);
    for (parameters.lambda = 0; parameters.lambda <= max_lambda; ++parameters.lambda) {
      for (parameters.h = 0; parameters.h <= max_h; ++parameters.h) {
        ASSERT_EQ(surface.at<int>(parameters.lambda, parameters.h),
                  segmentation.compute(gray, parameters, labels))
            << "lambda " << parameters.lambda << ", h " << parameters.h << " on\n"
            << gray;
      }
    }
  }
}

TEST(Segmentation, countsTheLabelsOfAKittiFrame) {
  const char* folder = std::getenv("DISPARITY_REFINEMENT_KITTI");
  if (folder == nullptr) {
    std::cout << "DISPARITY_REFINEMENT_KITTI is not set: no KITTI frame looked at\n";
    return;
  }
  const std::string file = std::string(folder) + "/image_0/000000_10.png";
  const cv::Mat gray = cv::imread(file, cv::IMREAD_GRAYSCALE);
  ASSERT_FALSE(gray.empty()) << file;
  Segmentation segmentation;
  cv::Mat labels;
  for (const Connectivity connectivity : BOTH_CONNECTIVITIES) {
    int former = static_cast<int>(gray.total());
    for (const auto& [lambda, h] : {std::pair{5, 2}, std::pair{30, 5}, std::pair{80, 15}}) {
      SegmentationParameters parameters;
      parameters.lambda = lambda;
      parameters.h = h;
      parameters.connectivity = connectivity;
      const int count = segmentation.compute(gray, parameters, labels);
      double largest = 0.0;
      cv::minMaxLoc(labels, nullptr, &largest);
      EXPECT_EQ(count - 1, static_cast<int>(largest));
      EXPECT_EQ(count, segmentation.countSurface(gray, parameters, lambda, h).at<int>(lambda, h));
      EXPECT_LT(count, former);
      former = count;
    }
  }
}

TEST(Segmentation, refusesOtherImages) {
  cv::Mat labels;
  const auto message = [&labels](const cv::Mat& gray) {
    return messageOf<std::invalid_argument>([&] { Segmentation().compute(gray, {}, labels); });
  };
  EXPECT_EQ(0U, message(cv::Mat()).find("gray is "));
  EXPECT_EQ(0U, message(cv::Mat(2, 3, CV_8UC3)).find("gray is CV_8UC3 of 3x2, expected CV_8UC1"));
}

TEST(SegmentationParameters, haveTheDefaultsOfTheHeader) {
  const SegmentationParameters parameters;
  EXPECT_NO_THROW(validate(parameters));
  EXPECT_EQ(30, parameters.lambda);
  EXPECT_EQ(5, parameters.h);
  EXPECT_EQ(Connectivity::EIGHT, parameters.connectivity);
  EXPECT_EQ(StructuringElement::SQUARE, parameters.gradient.structuring_element);
  EXPECT_TRUE(parameters.gradient.shadow_enhancement);
  EXPECT_EQ(50, parameters.gradient.shadow_threshold);
  EXPECT_EQ(0.45, parameters.gradient.shadow_gamma);
}

TEST(SegmentationParameters, areRefusedOutsideTheirRange) {
  const auto message = [](auto change) {
    SegmentationParameters parameters;
    change(parameters);
    const std::string validated = messageOf<std::invalid_argument>([&] { validate(parameters); });
    cv::Mat labels;
    const std::string computed = messageOf<std::invalid_argument>(
        [&] { Segmentation().compute(cv::Mat(2, 2, CV_8UC1, cv::Scalar(0)), parameters, labels); });
    EXPECT_EQ(validated, computed);
    return validated;
  };
  using P = SegmentationParameters;
  EXPECT_EQ("lambda is -1, expected at least 0", message([](P& p) { p.lambda = -1; }));
  EXPECT_EQ("h is -1, expected 0...255", message([](P& p) { p.h = -1; }));
  EXPECT_EQ("h is 256, expected 0...255", message([](P& p) { p.h = 256; }));
  EXPECT_EQ("connectivity is 5, expected 4 or 8",
            message([](P& p) { p.connectivity = static_cast<Connectivity>(5); }));
  EXPECT_EQ("shadow_threshold is 300, expected 0...255",
            message([](P& p) { p.gradient.shadow_threshold = 300; }));

  EXPECT_EQ("", message([](P& p) { p.lambda = 0; }));
  EXPECT_EQ("", message([](P& p) { p.lambda = 1000000000; }));
  EXPECT_EQ("", message([](P& p) { p.h = 0; }));
  EXPECT_EQ("", message([](P& p) { p.h = 255; }));
}

}  // namespace
}  // namespace disparity_refinement
