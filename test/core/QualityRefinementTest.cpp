#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "disparity_refinement/refinement/QualityRefinement.hpp"

namespace disparity_refinement {
namespace {

const float NOT_A_NUMBER = std::numeric_limits<float>::quiet_NaN();
const float INFINITE = std::numeric_limits<float>::infinity();
const DisparityRange RANGE{0.0F, 128.0F};
const PlaneRefinementParameters FIT;
const float HOLE = -1.0F;

struct Frame {
  explicit Frame(const cv::Size& size)
      : disparity(size, CV_32FC1, cv::Scalar(HOLE)),
        labels(size, CV_32SC1, cv::Scalar(0)),
        gray(size, CV_8UC1, cv::Scalar(100)) {}

  cv::Mat disparity, labels, gray;
};

struct Plane {
  double a, b, c;

  float at(int x, int y) const { return static_cast<float>(a * x + b * y + c); }
};

// The plane is measured, in steps of 1/16 px as matchers have it.
void measure(const Plane& plane, const cv::Rect& box, cv::Mat& disparity) {
  for (int y = box.y; y < box.y + box.height; ++y) {
    for (int x = box.x; x < box.x + box.width; ++x) {
      disparity.at<float>(y, x) = std::round(16.0F * plane.at(x, y)) / 16.0F;
    }
  }
}

void addNoise(double sigma, cv::Mat& disparity) {
  cv::RNG random(1);
  for (int y = 0; y < disparity.rows; ++y) {
    for (int x = 0; x < disparity.cols; ++x) {
      float& d = disparity.at<float>(y, x);
      if (d != HOLE) d += static_cast<float>(random.gaussian(sigma));
    }
  }
}

cv::Mat refine(const Frame& frame, const QualityParameters& parameters = {},
               const DisparityRange& range = RANGE) {
  cv::Mat refined;
  QualityRefinement().refine(frame.disparity, frame.labels, frame.gray, range, FIT, parameters, refined);
  return refined;
}

// The largest error within a part of the image, but for the pixel that stays invalid.
double largestError(const cv::Mat& refined, const Plane& plane, const cv::Rect& box) {
  double largest = 0.0;
  for (int y = box.y; y < box.y + box.height; ++y) {
    for (int x = box.x; x < box.x + box.width; ++x) {
      if (x == 0 && y == 0) continue;
      largest = std::max(largest, std::abs(1.0 * refined.at<float>(y, x) - plane.at(x, y)));
    }
  }
  return largest;
}

// Only what was measured and fitted.
QualityParameters nothingButPlanes() {
  QualityParameters parameters;
  parameters.selection.sweeps = 0;
  parameters.smoothing.sweeps = 0;
  parameters.label_pixels = false;
  parameters.medians = 0;
  return parameters;
}

// Blocks of random planes with holes, outliers, values that are none, and pixels of no segment.
Frame randomFrame(const cv::Size& size, int seed, const DisparityRange& range = RANGE) {
  cv::RNG random(seed);
  Frame frame(size);
  random.fill(frame.gray, cv::RNG::UNIFORM, 0, 256);
  const float span = range.max - range.min;
  const int across = (size.width + 9) / 10, blocks = across * ((size.height + 9) / 10);
  std::vector<Plane> planes;
  for (int i = 0; i < blocks; ++i) {
    planes.push_back({random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3), random.uniform(0.1, 0.9) * span});
  }
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const int block = y / 10 * across + x / 10;
      frame.labels.at<int>(y, x) = block % 7 == 6 ? -1 : block;
      const bool is_empty = block % 5 == 4;
      float& d = frame.disparity.at<float>(y, x);
      d = range.min + planes[block].at(x % 10, y % 10) + static_cast<float>(random.gaussian(0.2));
      const double kind = random.uniform(0.0, 1.0);
      if (kind < 0.3 || is_empty) d = range.invalid();
      if (kind < 0.1 && !is_empty) d = range.min + random.uniform(-0.1F, 1.1F) * span;
      if (kind < 0.02) d = NOT_A_NUMBER;
      if (kind < 0.01) d = kind < 0.005 ? INFINITE : -INFINITE;
    }
  }
  return frame;
}

// Bit for bit, so that NaN would count.
void expectSameBits(const cv::Mat& actual, const cv::Mat& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  ASSERT_EQ(actual.type(), expected.type());
  for (int y = 0; y < actual.rows; ++y) {
    EXPECT_TRUE(std::equal(actual.ptr(y), actual.ptr(y) + actual.cols * actual.elemSize(), expected.ptr(y)))
        << "row " << y;
  }
}

void expectMessage(const std::function<void()>& call, const std::string& message) {
  try {
    call();
    ADD_FAILURE() << "accepted, expected: " << message;
  } catch (const std::invalid_argument& error) {
    EXPECT_EQ(std::string(error.what()).substr(0, message.size()), message);
  }
}

// Scenes

TEST(QualityRefinement, keepsAHinge) {
  // A road below row 40 and a wall above it, with noise and holes.
  const Plane wall{0.0, 0.0, 20.0}, road{0.0, 0.5, 0.0};
  Frame frame({100, 80});
  measure(wall, {0, 0, 100, 40}, frame.disparity);
  measure(road, {0, 40, 100, 40}, frame.disparity);
  addNoise(0.3, frame.disparity);
  frame.disparity(cv::Rect(30, 20, 20, 40)).setTo(HOLE);
  frame.labels.rowRange(40, 80).setTo(1);
  frame.gray.rowRange(40, 80).setTo(60);
  const cv::Mat refined = refine(frame);
  EXPECT_LT(largestError(refined, wall, {0, 0, 100, 40}), 0.5);
  EXPECT_LT(largestError(refined, road, {0, 40, 25, 40}), 0.5);
  EXPECT_LT(largestError(refined, road, {55, 40, 45, 40}), 0.5);
  // In the hole the planes blend where they are near each other.
  EXPECT_LT(largestError(refined, road, {25, 40, 30, 40}), 1.0);
}

TEST(QualityRefinement, fillsTheOcclusionBesideABoxWithTheWall) {
  // A box of 30 px before a slanted wall. On its left the right camera sees no wall, so nothing is measured
  // there, and half of that is of the segment of the box.
  const Plane wall{0.05, 0.0, 14.0}, box{0.0, 0.0, 30.0};
  Frame frame({140, 60});
  measure(wall, {0, 0, 140, 60}, frame.disparity);
  measure(box, {60, 15, 40, 30}, frame.disparity);
  const cv::Rect occlusion(48, 15, 12, 30);
  frame.disparity(occlusion).setTo(HOLE);
  frame.labels(cv::Rect(54, 15, 46, 30)).setTo(1);
  frame.gray(cv::Rect(60, 15, 40, 30)).setTo(180);
  const cv::Mat refined = refine(frame);
  EXPECT_LT(largestError(refined, wall, {0, 0, 60, 60}), 0.2);
  EXPECT_LT(largestError(refined, wall, {100, 0, 40, 60}), 0.2);
  EXPECT_LT(largestError(refined, box, {63, 18, 34, 24}), 0.2);
  EXPECT_LT(largestError(refined, box, {60, 20, 40, 20}), 0.2);
}

TEST(QualityRefinement, fillsASegmentWithoutAnyDisparity) {
  const Plane road{0.05, 0.25, 10.0};
  Frame frame({90, 60});
  measure(road, {0, 0, 90, 60}, frame.disparity);
  for (int i = 0; i < 3; ++i) frame.labels.colRange(30 * i, 30 * (i + 1)).setTo(i);
  frame.disparity.colRange(30, 60).setTo(HOLE);
  // But for the rim, where the medians repeat what is beside them.
  EXPECT_LT(largestError(refine(frame), road, {2, 2, 86, 56}), 0.1);
  // Far off too, where nobody in the neighbourhood knows.
  for (int i = 0; i < 9; ++i) frame.labels.colRange(10 * i, 10 * (i + 1)).setTo(i);
  frame.disparity.colRange(10, 90).setTo(HOLE);
  EXPECT_LT(largestError(refine(frame), road, {0, 0, 90, 60}), 0.5);
}

TEST(QualityRefinement, carriesARoadThroughAShadow) {
  // Hardly anything is measured in the shadow, and half of that is wrong.
  const Plane road{0.0, 0.5, 5.0};
  Frame frame({120, 80});
  measure(road, {0, 0, 120, 80}, frame.disparity);
  addNoise(0.25, frame.disparity);
  const cv::Rect shadow(40, 20, 50, 40);
  cv::RNG random(2);
  for (int y = shadow.y; y < shadow.y + shadow.height; ++y) {
    for (int x = shadow.x; x < shadow.x + shadow.width; ++x) {
      const int kind = random.uniform(0, 100);
      if (kind >= 4) frame.disparity.at<float>(y, x) = HOLE;
      if (kind < 2) frame.disparity.at<float>(y, x) = random.uniform(0.0F, 100.0F);
    }
  }
  frame.labels(shadow).setTo(1);
  frame.gray(shadow).setTo(30);
  const cv::Mat refined = refine(frame);
  EXPECT_LT(largestError(refined, road, {5, 5, 110, 70}), 0.5);
}

TEST(QualityRefinement, keepsAThinPole) {
  const Plane wall{0.05, 0.0, 14.0}, pole{0.0, 0.0, 40.0};
  Frame frame({100, 60});
  measure(wall, {0, 0, 100, 60}, frame.disparity);
  measure(pole, {50, 0, 3, 60}, frame.disparity);
  frame.gray.colRange(50, 53).setTo(20);
  const cv::Mat refined = refine(frame);  // All of one segment.
  EXPECT_LT(largestError(refined, pole, {50, 0, 3, 60}), 0.5);
  EXPECT_LT(largestError(refined, wall, {0, 0, 50, 60}), 0.5);
  EXPECT_LT(largestError(refined, wall, {53, 0, 47, 60}), 0.5);
}

TEST(QualityRefinement, keepsADepthStep) {
  const Plane left{0.0, 0.0, 20.0}, right{0.1, 0.0, 30.0};
  Frame frame({80, 40});
  measure(left, {0, 0, 40, 40}, frame.disparity);
  measure(right, {40, 0, 40, 40}, frame.disparity);
  frame.labels.colRange(40, 80).setTo(1);
  frame.gray.colRange(40, 80).setTo(160);
  const cv::Mat refined = refine(frame);
  EXPECT_LT(largestError(refined, left, {0, 0, 40, 40}), 0.1);
  EXPECT_LT(largestError(refined, right, {40, 0, 40, 40}), 0.1);
}

// Steps

TEST(QualityRefinement, writesTheFittedPlanesWithoutItsSteps) {
  const Frame frame = randomFrame({97, 61}, 3);
  PlaneRefinementParameters fit;
  fit.max_divergence = 1.5;
  QualityRefinement refinement;
  cv::Mat refined;
  refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, fit, nothingButPlanes(), refined);
  int from_planes = 0, measured = 0, invalid = 0;
  for (int y = 0; y < 61; ++y) {
    for (int x = 0; x < 97; ++x) {
      const int label = frame.labels.at<int>(y, x);
      const float d = frame.disparity.at<float>(y, x);
      const bool is_measured = std::isfinite(d) && d >= 0.0F;
      float expected = is_measured ? d : HOLE;
      if (label >= 0 && refinement.planes()[label].is_known) {
        const float value = static_cast<float>(refinement.planes()[label].at(x, y));
        if (!is_measured || std::abs(value - d) <= 1.5) expected = std::min(std::max(value, 0.0F), 128.0F);
      }
      ASSERT_EQ(refined.at<float>(y, x), expected) << x << ", " << y;
      (expected == HOLE ? invalid : expected == d ? measured : from_planes) += 1;
    }
  }
  EXPECT_GT(from_planes, 1000);
  EXPECT_GT(measured, 300);
  EXPECT_GT(invalid, 300);  // Segments without any disparity.
}

TEST(QualityRefinement, givesPlanesToSegmentsWithoutAnyByTheSelection) {
  const Frame frame = randomFrame({97, 61}, 4);
  QualityRefinement refinement;
  cv::Mat refined;
  const auto known = [&](const QualityParameters& parameters) {
    refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, parameters, refined);
    return std::count_if(refinement.planes().begin(), refinement.planes().end(),
                         [](const DisparityPlane& plane) { return plane.is_known; });
  };
  QualityParameters parameters = nothingButPlanes();
  const auto fitted = known(parameters);
  parameters.smoothing.sweeps = 3;
  EXPECT_EQ(known(parameters), fitted);
  parameters.selection.sweeps = 1;
  EXPECT_GT(known(parameters), fitted + 5);
  const int holes = cv::countNonZero(refined == HOLE);
  parameters.label_pixels = true;
  parameters.medians = 2;
  EXPECT_GT(known(parameters), fitted + 5);
  EXPECT_LT(cv::countNonZero(refined == HOLE), holes + 1);
}

TEST(QualityRefinement, movesPlanesByTheSmoothingOnlyWhereItSweeps) {
  // Two fits of one noisy plane: a step between them, unless they are smoothed.
  const Plane plane{0.1, 0.2, 20.0};
  Frame frame({40, 30});
  measure(plane, {0, 0, 40, 30}, frame.disparity);
  addNoise(1.0, frame.disparity);
  frame.labels.colRange(20, 40).setTo(1);
  QualityRefinement refinement;
  cv::Mat refined;
  const auto largestStep = [&](const QualityParameters& parameters) {
    refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, parameters, refined);
    const auto& planes = refinement.planes();
    return std::max(std::abs(planes[0].at(19.5, 0) - planes[1].at(19.5, 0)),
                    std::abs(planes[0].at(19.5, 29) - planes[1].at(19.5, 29)));
  };
  QualityParameters parameters = nothingButPlanes();
  const double step = largestStep(parameters);
  ASSERT_GT(step, 0.1);
  parameters.medians = 3;
  parameters.label_pixels = true;
  EXPECT_EQ(largestStep(parameters), step) << "other steps leave the planes";
  parameters.smoothing.sweeps = 5;
  EXPECT_LT(largestStep(parameters), 0.75 * step);
}

TEST(QualityRefinement, labelsPixelsAsPixelLabelingDoes) {
  const Frame frame = randomFrame({97, 61}, 5);
  QualityParameters parameters;
  parameters.medians = 0;
  parameters.half_contrast = 17.0;
  parameters.labeling.soft_reach = 2.0;
  QualityRefinement refinement;
  cv::Mat refined;
  refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, parameters, refined);

  cv::Mat measured, expected(frame.labels.size(), CV_32FC1);
  copyValid(frame.disparity, RANGE, measured);
  SegmentRuns segments;
  segments.build(frame.labels);
  SegmentGraph graph;
  graph.build(frame.labels, frame.gray, segments.size(), 17.0);
  PixelLabeling().compute(measured, frame.gray, RANGE, segments, graph, refinement.planes(), {},
                          parameters.labeling, expected);
  expectSameBits(refined, expected);
}

TEST(QualityRefinement, takesThePlanesOfFurtherSegmentations) {
  // The image has random segments, which blocks of labels are not.
  const Frame frame = randomFrame({97, 61}, 5);
  QualityParameters parameters;
  parameters.medians = 0;
  parameters.further.resize(2);
  parameters.further[0].lambda = 10;
  parameters.further[1].lambda = 40;
  QualityRefinement refinement;
  cv::Mat refined;
  refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, parameters, refined);

  cv::Mat measured, ignored, expected(frame.labels.size(), CV_32FC1);
  copyValid(frame.disparity, RANGE, measured);
  QualityParameters alone = parameters;
  alone.further.clear();
  std::vector<cv::Mat> labels(2);
  std::vector<QualityRefinement> others(2);
  std::vector<FurtherPlanes> further;
  for (int i = 0; i < 2; ++i) {
    Segmentation().compute(frame.gray, parameters.further[i], labels[i]);
    others[i].refine(frame.disparity, labels[i], frame.gray, RANGE, FIT, alone, ignored);
    further.push_back({&labels[i], &others[i].planes()});
  }
  SegmentRuns segments;
  segments.build(frame.labels);
  SegmentGraph graph;
  graph.build(frame.labels, frame.gray, segments.size(), parameters.half_contrast);
  PixelLabeling().compute(measured, frame.gray, RANGE, segments, graph, refinement.planes(), further,
                          parameters.labeling, expected);
  expectSameBits(refined, expected);
  EXPECT_GT(cv::norm(refined, refine(frame, alone), cv::NORM_INF), 1.0);
  // Fewer of them in a used object.
  refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, alone, refined);
  expectSameBits(refined, refine(frame, alone));
}

TEST(QualityRefinement, filtersByMedians) {
  const Frame frame = randomFrame({97, 61}, 6);
  for (const bool label_pixels : {true, false}) {
    QualityParameters parameters;
    parameters.label_pixels = label_pixels;
    parameters.medians = 0;
    cv::Mat expected = refine(frame, parameters);
    ASSERT_GT(cv::countNonZero(expected == HOLE), 0) << "none is made invalid before a filter";
    for (int medians = 1; medians <= 5; ++medians) {
      parameters.medians = medians;
      cv::Mat filtered;
      cv::medianBlur(expected, filtered, 5);
      expected = filtered;
      cv::Mat one_invalid = expected.clone();
      keepOneInvalid(one_invalid, RANGE);
      expectSameBits(refine(frame, parameters), one_invalid);
    }
  }
}

// Pixels

TEST(QualityRefinement, takesWhatIsNoDisparityForHoles) {
  Frame frame = randomFrame({97, 61}, 7), holes({97, 61});
  holes.labels = frame.labels;
  holes.gray = frame.gray;
  int none = 0;
  for (int y = 0; y < 61; ++y) {
    for (int x = 0; x < 97; ++x) {
      float& d = frame.disparity.at<float>(y, x);
      if (x % 11 == 0) d = -0.001F;  // Below the range.
      const bool is_disparity = std::isfinite(d) && d >= 0.0F;
      holes.disparity.at<float>(y, x) = is_disparity ? d : HOLE;
      none += std::isfinite(d) ? 0 : 1;
    }
  }
  ASSERT_GT(none, 50);
  for (const int medians : {0, 3}) {
    QualityParameters parameters;
    parameters.medians = medians;
    const cv::Mat refined = refine(frame, parameters);
    expectSameBits(refined, refine(holes, parameters));
    EXPECT_TRUE(cv::checkRange(refined, true, nullptr, -1.0, 145.0));
  }
}

TEST(QualityRefinement, leavesAtLeastOneInvalidPixel) {
  Frame frame({40, 30});
  measure({0.1, 0.2, 20.0}, {0, 0, 40, 30}, frame.disparity);
  for (const int medians : {0, 1, 2, 3}) {
    for (const bool label_pixels : {true, false}) {
      QualityParameters parameters;
      parameters.medians = medians;
      parameters.label_pixels = label_pixels;
      const cv::Mat refined = refine(frame, parameters);
      EXPECT_EQ(refined.at<float>(0, 0), HOLE);
      EXPECT_EQ(cv::countNonZero(refined == HOLE), 1);
    }
  }
}

TEST(QualityRefinement, keepsThePixelsOfNegativeLabels) {
  Frame frame({40, 30});
  measure({0.1, 0.2, 20.0}, {0, 0, 40, 30}, frame.disparity);
  frame.disparity.row(10).setTo(33.03F);
  frame.disparity.row(11).setTo(NOT_A_NUMBER);
  frame.labels.row(10).setTo(-1);
  frame.labels.row(11).setTo(std::numeric_limits<int>::min());
  for (const bool label_pixels : {true, false}) {
    QualityParameters parameters;
    parameters.label_pixels = label_pixels;
    parameters.medians = 0;
    const cv::Mat refined = refine(frame, parameters);
    EXPECT_EQ(cv::countNonZero(refined.row(10) == 33.03F), 40);
    EXPECT_EQ(cv::countNonZero(refined.row(11) == HOLE), 40);
  }
  // Nothing but such pixels.
  frame.labels.setTo(-1);
  QualityParameters parameters;
  parameters.medians = 0;
  QualityRefinement refinement;
  cv::Mat refined, expected;
  copyValid(frame.disparity, RANGE, expected);
  refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, parameters, refined);
  expectSameBits(refined, expected);
  EXPECT_TRUE(refinement.planes().empty());
}

TEST(QualityRefinement, leavesAMapWithoutAnyDisparity) {
  Frame frame = randomFrame({40, 30}, 8);
  for (const float nothing : {HOLE, -1000.0F, NOT_A_NUMBER, INFINITE}) {
    frame.disparity.setTo(nothing);
    QualityRefinement refinement;
    cv::Mat refined;
    refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, {}, refined);
    EXPECT_EQ(cv::countNonZero(refined == HOLE), 40 * 30);
    for (const DisparityPlane& plane : refinement.planes()) EXPECT_FALSE(plane.is_known);
  }
}

TEST(QualityRefinement, refinesWithinTheRange) {
  for (const DisparityRange range :
       {DisparityRange{-64.0F, 64.0F}, DisparityRange{-40.0F, -8.0F}, DisparityRange{0.0F, 2048.0F}}) {
    Frame frame = randomFrame({97, 61}, 9, range);
    for (int y = 0; y < 61; ++y) {
      for (int x = 0; x < 97; ++x) {
        float& d = frame.disparity.at<float>(y, x);
        if (d > range.max) d = range.max;
      }
    }
    for (const bool label_pixels : {true, false}) {
      QualityParameters parameters;
      parameters.label_pixels = label_pixels;
      const cv::Mat refined = refine(frame, parameters, range);
      int valid = 0;
      for (int y = 0; y < 61; ++y) {
        for (int x = 0; x < 97; ++x) {
          const float d = refined.at<float>(y, x);
          ASSERT_TRUE((d >= range.min && d <= range.max) || d == range.invalid()) << d;
          valid += d == range.invalid() ? 0 : 1;
        }
      }
      EXPECT_GT(valid, 97 * 61 * 2 / 3);
    }
  }
}

TEST(QualityRefinement, doesNotRoundBeyondTheRange) {
  // The largest disparity lies between two steps of 1/16 px.
  const DisparityRange range{0.0F, 10.04F};
  Frame frame({40, 30});
  frame.disparity.setTo(range.max);
  frame.disparity.colRange(10, 20).setTo(range.invalid());
  double largest = 0.0;
  cv::minMaxLoc(refine(frame, {}, range), nullptr, &largest);
  EXPECT_LE(largest, range.max);
  EXPECT_GT(largest, 10.0);
}

TEST(QualityRefinement, movesWithTheRange) {
  // The same scene 64 px lower, and the range too. What the right camera sees is another matter.
  const Frame frame = randomFrame({97, 61}, 10);
  Frame lower = frame;
  lower.disparity = cv::Mat(frame.disparity - 64.0);
  QualityParameters parameters;
  parameters.labeling.visibility_cost = 0.0;
  const cv::Mat refined = refine(frame, parameters);
  const cv::Mat moved = refine(lower, parameters, {-64.0F, 64.0F});
  int differ = 0;
  for (int y = 0; y < 61; ++y) {
    for (int x = 0; x < 97; ++x) {
      differ += std::abs(refined.at<float>(y, x) - 64.0F - moved.at<float>(y, x)) > 0.1F ? 1 : 0;
    }
  }
  EXPECT_LT(differ, 97 * 61 / 100);
}

TEST(QualityRefinement, measuresDisparitiesUpTo2048) {
  const DisparityRange range{0.0F, 2048.0F};
  Frame frame({60, 40});
  measure({1.0 / 16.0, 0.0, 2030.0}, {0, 0, 60, 40}, frame.disparity);
  frame.disparity.colRange(20, 30).setTo(range.invalid());
  const cv::Mat refined = refine(frame, {}, range);
  EXPECT_LT(largestError(refined, {1.0 / 16.0, 0.0, 2030.0}, {2, 2, 56, 36}), 0.1);
}

// Images

TEST(QualityRefinement, takesImagesOfEverySize) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(17, 1), cv::Size(1, 17), cv::Size(2, 2),
                              cv::Size(3, 4), cv::Size(5, 5), cv::Size(65, 33)}) {
    for (const int medians : {0, 1, 3}) {
      for (const bool label_pixels : {true, false}) {
        Frame frame(size);
        frame.disparity.setTo(20.0F);
        frame.disparity.at<float>(size.height - 1, size.width - 1) = HOLE;
        QualityParameters parameters;
        parameters.medians = medians;
        parameters.label_pixels = label_pixels;
        PlaneRefinementParameters fit;
        fit.min_valid_points = 3;
        cv::Mat refined;
        QualityRefinement().refine(frame.disparity, frame.labels, frame.gray, RANGE, fit, parameters,
                                   refined);
        ASSERT_EQ(refined.size(), size);
        for (int y = 0; y < size.height; ++y) {
          for (int x = 0; x < size.width; ++x) {
            const float d = refined.at<float>(y, x);
            EXPECT_TRUE(d == 20.0F || d == HOLE) << size << " x " << x << " y " << y << ": " << d;
          }
        }
        const int least = size.area() > 1 ? (size.area() + 1) / 2 : 0;
        EXPECT_GE(cv::countNonZero(refined == 20.0F), least) << size;
      }
    }
    // As many segments as pixels.
    Frame frame(size);
    frame.disparity.setTo(20.0F);
    for (int i = 0; i < size.area(); ++i) frame.labels.at<int>(i / size.width, i % size.width) = i;
    EXPECT_EQ(refine(frame).size(), size);
  }
}

TEST(QualityRefinement, takesPartsOfLargerImages) {
  const Frame frame = randomFrame({51, 37}, 11);
  for (const int medians : {0, 1, 2, 3}) {
    QualityParameters parameters;
    parameters.medians = medians;
    const cv::Mat expected = refine(frame, parameters);
    cv::Mat disparity(60, 90, CV_32FC1, cv::Scalar(77)), labels(60, 90, CV_32SC1, cv::Scalar(1 << 30)),
        gray(60, 90, CV_8UC1, cv::Scalar(3)), refined(60, 90, CV_32FC1, cv::Scalar(55));
    cv::Mat part_disparity = disparity(cv::Rect(3, 5, 51, 37)), part_labels = labels(cv::Rect(20, 2, 51, 37)),
            part_gray = gray(cv::Rect(7, 11, 51, 37)), part_refined = refined(cv::Rect(39, 23, 51, 37));
    frame.disparity.copyTo(part_disparity);
    frame.labels.copyTo(part_labels);
    frame.gray.copyTo(part_gray);
    QualityRefinement().refine(part_disparity, part_labels, part_gray, RANGE, FIT, parameters, part_refined);
    expectSameBits(part_refined, expected);
    EXPECT_EQ(part_refined.data, refined.ptr(23) + 39 * sizeof(float));
    EXPECT_EQ(cv::countNonZero(refined != 55.0F), cv::countNonZero(part_refined != 55.0F));
  }
}

TEST(QualityRefinement, writesIntoAnOutputOfTheRightTypeAndSize) {
  const Frame frame = randomFrame({31, 21}, 12);
  const cv::Mat disparity = frame.disparity.clone(), labels = frame.labels.clone(), gray = frame.gray.clone();
  for (const int medians : {0, 1, 2, 3}) {
    QualityParameters parameters;
    parameters.medians = medians;
    cv::Mat refined(frame.labels.size(), CV_32FC1), other(2, 2, CV_8UC1);
    const uchar* const data = refined.data;
    QualityRefinement refinement;
    refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, parameters, refined);
    EXPECT_EQ(refined.data, data);
    refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, parameters, other);
    expectSameBits(other, refined);
  }
  expectSameBits(frame.disparity, disparity);
  expectSameBits(frame.labels, labels);
  expectSameBits(frame.gray, gray);
}

TEST(QualityRefinement, isTheSameForAnyNumberOfThreads) {
  const int threads_before = cv::getNumThreads();
  for (const cv::Size size : {cv::Size(163, 121), cv::Size(3, 90), cv::Size(90, 2), cv::Size(1, 1)}) {
    const Frame frame = randomFrame(size, 13);
    for (const bool label_pixels : {true, false}) {
      QualityParameters parameters;
      parameters.label_pixels = label_pixels;
      cv::setNumThreads(1);
      const cv::Mat expected = refine(frame, parameters);
      for (const int threads : {2, 3, 7}) {
        cv::setNumThreads(threads);
        expectSameBits(refine(frame, parameters), expected);
      }
    }
  }
  cv::setNumThreads(threads_before);
}

TEST(QualityRefinement, isTheSameInAUsedObject) {
  QualityRefinement used;
  cv::Mat from_used;
  int seed = 20;
  for (const cv::Size size :
       {cv::Size(80, 60), cv::Size(33, 21), cv::Size(1, 1), cv::Size(97, 71), cv::Size(80, 60)}) {
    for (const bool label_pixels : {true, false}) {
      const Frame frame = randomFrame(size, ++seed);
      QualityParameters parameters;
      parameters.label_pixels = label_pixels;
      parameters.medians = seed % 4;
      QualityRefinement fresh;
      cv::Mat from_fresh;
      used.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, parameters, from_used);
      fresh.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, parameters, from_fresh);
      expectSameBits(from_used, from_fresh);
      ASSERT_EQ(used.planes().size(), fresh.planes().size());
      for (std::size_t i = 0; i < used.planes().size(); ++i) {
        EXPECT_EQ(used.planes()[i].is_known, fresh.planes()[i].is_known);
        EXPECT_EQ(used.planes()[i].c, fresh.planes()[i].c);
      }
    }
  }
}

// Bad input

TEST(QualityRefinement, refusesBadImages) {
  const Frame frame = randomFrame({6, 4}, 30);
  cv::Mat refined;
  const auto refine = [&](const cv::Mat& d, const cv::Mat& l, const cv::Mat& g) {
    return [&refined, d, l, g] { QualityRefinement().refine(d, l, g, RANGE, FIT, {}, refined); };
  };
  const cv::Mat &d = frame.disparity, &l = frame.labels, &g = frame.gray;
  expectMessage(refine(cv::Mat(), l, g), "disparity is CV_8UC1 of 0x0, expected CV_32FC1 of 0x0, not empty");
  expectMessage(refine(cv::Mat(4, 6, CV_16SC1), l, g), "disparity is CV_16SC1 of 6x4, expected CV_32FC1");
  expectMessage(refine(d, cv::Mat(4, 5, CV_32SC1), g), "labels is CV_32SC1 of 5x4, expected CV_32SC1 of 6x4");
  expectMessage(refine(d, cv::Mat(4, 6, CV_32FC1), g), "labels is CV_32FC1 of 6x4, expected CV_32SC1 of 6x4");
  expectMessage(refine(d, cv::Mat(), g), "labels is CV_8UC1 of 0x0, expected CV_32SC1 of 6x4");
  expectMessage(refine(d, l, cv::Mat(4, 6, CV_8UC3)), "gray is CV_8UC3 of 6x4, expected CV_8UC1 of 6x4");
  expectMessage(refine(d, l, cv::Mat(6, 4, CV_8UC1)), "gray is CV_8UC1 of 4x6, expected CV_8UC1 of 6x4");
  expectMessage(refine(d, l, cv::Mat()), "gray is CV_8UC1 of 0x0, expected CV_8UC1 of 6x4");
  expectMessage(refine(d, cv::Mat(4, 6, CV_32SC1, cv::Scalar(24)), g),
                "labels is 24 at x = 0, y = 0, expected less than the number of pixels, 24");
  const int sizes[] = {4, 6, 2};
  expectMessage(refine(cv::Mat(3, sizes, CV_32FC1), l, g), "disparity is CV_32FC1 of");
  EXPECT_TRUE(refined.empty());
}

TEST(QualityRefinement, refusesAnOutputThatSharesMemoryWithAnInput) {
  Frame frame = randomFrame({6, 4}, 31);
  const cv::Mat disparity = frame.disparity.clone(), labels = frame.labels.clone(), gray = frame.gray.clone();
  QualityRefinement refinement;
  for (cv::Mat* shared : {&frame.disparity, &frame.labels, &frame.gray}) {
    expectMessage(
        [&] { refinement.refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, {}, *shared); },
        "refined is the memory of an input, expected an image of its own");
  }
  cv::Mat large(9, 6, CV_32FC1, cv::Scalar(20));
  cv::Mat upper = large.rowRange(0, 4), lower = large.rowRange(3, 7), below = large.rowRange(4, 8);
  expectMessage([&] { refinement.refine(upper, frame.labels, frame.gray, RANGE, FIT, {}, lower); },
                "refined is the memory of an input");
  EXPECT_NO_THROW(refinement.refine(upper, frame.labels, frame.gray, RANGE, FIT, {}, below));
  expectSameBits(frame.disparity, disparity);
  expectSameBits(frame.labels, labels);
  expectSameBits(frame.gray, gray);
}

TEST(QualityRefinement, refusesABadRange) {
  const Frame frame = randomFrame({6, 4}, 32);
  const auto refineIn = [&](const DisparityRange& range) { return [&, range] { refine(frame, {}, range); }; };
  expectMessage(refineIn({NOT_A_NUMBER, 64.0F}), "range.min is nan");
  expectMessage(refineIn({-INFINITE, 64.0F}), "range.min is -inf");
  expectMessage(refineIn({-1e9F, 64.0F}), "range.min is -1e+09");
  expectMessage(refineIn({0.0F, INFINITE}), "range.max is inf");
  expectMessage(refineIn({0.0F, NOT_A_NUMBER}), "range.max is nan");
  expectMessage(refineIn({0.0F, -1.0F}), "range.max is -1, expected a finite number, at least range.min");
  EXPECT_NO_THROW(refineIn({5.0F, 5.0F})());
}

TEST(QualityRefinement, validatesEveryParameter) {
  using P = QualityParameters;
  EXPECT_NO_THROW(validate(P()));
  const Frame frame = randomFrame({6, 4}, 33);
  const cv::Mat untouched(4, 6, CV_32FC1, cv::Scalar(55));
  cv::Mat refined = untouched.clone();
  const uchar* const data = refined.data;
  const auto expectRefused = [&](const std::string& message, const std::function<void(P&)>& change) {
    P parameters;
    change(parameters);
    expectMessage([&] { validate(parameters); }, message);
    expectMessage(
        [&] {
          QualityRefinement().refine(frame.disparity, frame.labels, frame.gray, RANGE, FIT, parameters,
                                     refined);
        },
        message);
    expectSameBits(refined, untouched);
    EXPECT_EQ(refined.data, data);
  };
  const auto expectAccepted = [](const std::function<void(P&)>& change) {
    P parameters;
    change(parameters);
    EXPECT_NO_THROW(validate(parameters));
  };
  const double nan = NOT_A_NUMBER, inf = INFINITE;

  PlaneRefinementParameters fit;
  fit.inlier_threshold = 0.0;
  expectMessage(
      [&] { QualityRefinement().refine(frame.disparity, frame.labels, frame.gray, RANGE, fit, {}, refined); },
      "inlier_threshold is 0,");
  expectSameBits(refined, untouched);
  expectRefused("selection.sweeps is -1, expected at least 0", [](P& p) { p.selection.sweeps = -1; });
  expectRefused("smoothing.sweeps is -1, expected at least 0", [](P& p) { p.smoothing.sweeps = -1; });
  expectRefused("medians is -1, expected at least 0", [](P& p) { p.medians = -1; });
  expectAccepted([](P& p) { p.selection.sweeps = p.smoothing.sweeps = p.medians = 0; });

  const auto expectPositive = [&](const std::string& name, const std::function<double&(P&)>& parameter) {
    expectRefused(name + " is 0, expected greater than 0", [&](P& p) { parameter(p) = 0.0; });
    expectRefused(name + " is -0.5, expected greater than 0", [&](P& p) { parameter(p) = -0.5; });
    expectRefused(name + " is nan", [&](P& p) { parameter(p) = nan; });
    expectRefused(name + " is inf", [&](P& p) { parameter(p) = inf; });
    expectAccepted([&](P& p) { parameter(p) = 0.01; });
  };
  expectPositive("half_contrast", [](P& p) -> double& { return p.half_contrast; });
  expectPositive("selection.data_truncation", [](P& p) -> double& { return p.selection.data_truncation; });
  expectPositive("selection.border_truncation",
                 [](P& p) -> double& { return p.selection.border_truncation; });
  expectPositive("smoothing.inlier_threshold", [](P& p) -> double& { return p.smoothing.inlier_threshold; });
  expectPositive("smoothing.max_step", [](P& p) -> double& { return p.smoothing.max_step; });
  expectPositive("labeling.data_truncation", [](P& p) -> double& { return p.labeling.data_truncation; });
  expectPositive("labeling.half_contrast", [](P& p) -> double& { return p.labeling.half_contrast; });
  expectPositive("labeling.step_truncation", [](P& p) -> double& { return p.labeling.step_truncation; });
  expectPositive("labeling.half_cost", [](P& p) -> double& { return p.labeling.half_cost; });

  const auto expectCost = [&](const std::string& name, const std::function<double&(P&)>& parameter) {
    expectRefused(name + " is -0.5, expected 0...", [&](P& p) { parameter(p) = -0.5; });
    expectRefused(name + " is nan", [&](P& p) { parameter(p) = nan; });
    expectRefused(name + " is inf", [&](P& p) { parameter(p) = inf; });
    expectAccepted([&](P& p) { parameter(p) = 0.0; });
  };
  expectCost("selection.border_weight", [](P& p) -> double& { return p.selection.border_weight; });
  expectCost("smoothing.border_weight", [](P& p) -> double& { return p.smoothing.border_weight; });
  expectCost("labeling.data_weight", [](P& p) -> double& { return p.labeling.data_weight; });
  expectCost("labeling.edge_share", [](P& p) -> double& { return p.labeling.edge_share; });
  expectCost("labeling.edge_step", [](P& p) -> double& { return p.labeling.edge_step; });
  expectCost("labeling.neighbour_cost", [](P& p) -> double& { return p.labeling.neighbour_cost; });
  expectCost("labeling.neighbour_cost_in_hole",
             [](P& p) -> double& { return p.labeling.neighbour_cost_in_hole; });
  expectCost("labeling.further_cost", [](P& p) -> double& { return p.labeling.further_cost; });
  expectCost("labeling.further_cost_in_hole",
             [](P& p) -> double& { return p.labeling.further_cost_in_hole; });
  expectCost("labeling.measured_cost", [](P& p) -> double& { return p.labeling.measured_cost; });
  expectCost("labeling.visibility_cost", [](P& p) -> double& { return p.labeling.visibility_cost; });
  expectCost("labeling.smoothness", [](P& p) -> double& { return p.labeling.smoothness; });
  expectCost("labeling.soft_reach", [](P& p) -> double& { return p.labeling.soft_reach; });

  // What 16 bits hold.
  expectRefused("labeling.data_weight is 10.1,", [](P& p) { p.labeling.data_weight = 10.1; });
  expectRefused("labeling.data_truncation is 16.1,", [](P& p) { p.labeling.data_truncation = 16.1; });
  expectRefused("labeling.data_weight * data_truncation is 16,", [](P& p) {
    p.labeling.data_weight = 8.0;
    p.labeling.data_truncation = 2.0;
  });
  expectRefused("labeling.edge_share is 1.1,", [](P& p) { p.labeling.edge_share = 1.1; });
  expectRefused("labeling.edge_reach is -1, expected 0...16", [](P& p) { p.labeling.edge_reach = -1; });
  expectRefused("labeling.edge_reach is 17, expected 0...16", [](P& p) { p.labeling.edge_reach = 17; });
  expectRefused("labeling.edge_step is 2049,", [](P& p) { p.labeling.edge_step = 2049.0; });
  expectAccepted([](P& p) { p.labeling.edge_reach = 0; });
  expectRefused("labeling.neighbour_cost is 101,", [](P& p) { p.labeling.neighbour_cost = 101.0; });
  expectRefused("labeling.neighbour_cost_in_hole is 101,",
                [](P& p) { p.labeling.neighbour_cost_in_hole = 101.0; });
  expectRefused("labeling.further_cost is 101,", [](P& p) { p.labeling.further_cost = 101.0; });
  expectRefused("labeling.further_cost_in_hole is 101,",
                [](P& p) { p.labeling.further_cost_in_hole = 101.0; });
  expectRefused("number of further segmentations is 6, expected at most 5",
                [](P& p) { p.further.resize(6); });
  expectRefused("lambda is -1,", [](P& p) { p.further.resize(1), p.further[0].lambda = -1; });
  expectAccepted([](P& p) { p.further.resize(5); });
  expectRefused("labeling.measured_cost is 101,", [](P& p) { p.labeling.measured_cost = 101.0; });
  expectRefused("labeling.visibility_cost is 101,", [](P& p) { p.labeling.visibility_cost = 101.0; });
  expectRefused("labeling.step_truncation is 16.1,", [](P& p) {
    p.labeling.smoothness = 0.1;
    p.labeling.step_truncation = 16.1;
  });
  expectRefused("labeling.smoothness * step_truncation is 16,", [](P& p) {
    p.labeling.smoothness = 4.0;
    p.labeling.step_truncation = 4.0;
  });
  expectRefused("labeling.soft_reach is 1001,", [](P& p) { p.labeling.soft_reach = 1001.0; });
  expectRefused("labeling.half_cost is 101,", [](P& p) { p.labeling.half_cost = 101.0; });
}

}  // namespace
}  // namespace disparity_refinement
