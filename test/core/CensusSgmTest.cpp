#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "disparity_refinement/matching/CensusSgm.hpp"
#include "straightforward/CensusSgm.hpp"

namespace disparity_refinement {
namespace {

struct StereoPair {
  cv::Mat left, right;

  StereoPair part(const cv::Rect& rect) const { return {left(rect), right(rect)}; }
};

/// Random pairs: noise, texture with a sloped disparity, with a step of disparity, or of few gray levels,
/// where sums are equal often.
class RandomPairs {
 public:
  explicit RandomPairs(unsigned seed) : rng_(seed) {}

  int number(int begin, int end) { return rng_.uniform(begin, end); }

  template <class T>
  T oneOf(const std::vector<T>& values) {
    return values[number(0, static_cast<int>(values.size()))];
  }

  StereoPair noise(const cv::Size& size, int gray_levels = 256) {
    StereoPair pair{cv::Mat(size, CV_8UC1), cv::Mat(size, CV_8UC1)};
    rng_.fill(pair.left, cv::RNG::UNIFORM, 0, gray_levels);
    rng_.fill(pair.right, cv::RNG::UNIFORM, 0, gray_levels);
    return pair;
  }

  StereoPair textured(const cv::Size& size, const std::function<int(int x, int y)>& disparity) {
    cv::Mat texture = noise({size.width + 2 * MARGIN, size.height}).left;
    cv::GaussianBlur(texture, texture, cv::Size(3, 3), 0.7);
    StereoPair pair{cv::Mat(size, CV_8UC1), texture.colRange(MARGIN, MARGIN + size.width).clone()};
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        pair.left.at<uchar>(y, x) =
            texture.at<uchar>(y, MARGIN + std::clamp(x - disparity(x, y), -MARGIN, size.width + MARGIN - 1));
      }
    }
    const cv::Mat grain = noise(size, 9).left;
    pair.left += grain;
    return pair;
  }

  /// One of those, with disparities inside the range for the most part.
  StereoPair any(const cv::Size& size, const CensusSgmParameters& p) {
    const int near = p.min_disparity + p.disparity_range / 2, far = p.min_disparity + p.disparity_range / 8;
    switch (number(0, 5)) {
      case 0:
        return noise(size);
      case 1:
        return noise(size, 3);
      case 2:
        return textured(size, [=](int, int y) { return far + y / 3; });
      case 3:
        return textured(size, [=](int x, int) { return x < size.width / 2 ? near : far; });
      default: {
        // Flat on one side.
        StereoPair pair = textured(size, [=](int x, int) { return near + x / 9; });
        pair.left.colRange(size.width / 2, size.width) = 90;
        pair.right.colRange(size.width / 3, size.width) = 90;
        return pair;
      }
    }
  }

 private:
  static constexpr int MARGIN = 100;

  cv::RNG rng_;
};

CensusSgmParameters parametersOf(int disparity_range, int min_disparity = 0) {
  CensusSgmParameters p;
  p.disparity_range = disparity_range;
  p.min_disparity = min_disparity;
  return p;
}

std::string describe(const cv::Size& size, const CensusSgmParameters& p) {
  const auto text = [](const char* name, int value) {
    return std::string(", ") + name + " " + std::to_string(value);
  };
  return std::to_string(size.width) + "x" + std::to_string(size.height) +
         text("disparity_range", p.disparity_range) + text("min_disparity", p.min_disparity) +
         text("P1", p.p1) + text("P2", p.p2) + text("uniqueness_ratio", p.uniqueness_ratio) +
         text("disp12_max_diff", p.disp12_max_diff) + text("aggregate_rows", p.aggregate_rows);
}

bool sameBits(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0.0;
}

/// Matchers with vectors of either width, which keep their buffers from one pair to the next.
class Matchers {
 public:
  void expectReference(const StereoPair& pair, const CensusSgmParameters& p, int threads = 1) {
    const cv::Mat expected = straightforward::matchCensus(pair.left, pair.right, p);
    cv::Mat disparity;
    widest_.compute(pair.left, pair.right, p, disparity, threads);
    EXPECT_TRUE(sameBits(disparity, expected)) << "widest vectors, " << describe(pair.left.size(), p);
    bytes_16_.compute(pair.left, pair.right, p, disparity, threads);
    EXPECT_TRUE(sameBits(disparity, expected)) << "16 bytes, " << describe(pair.left.size(), p);
  }

 private:
  CensusSgm widest_, bytes_16_{CensusSgm::Vectors::BYTES_16};
};

cv::Mat disparityOf(const StereoPair& pair, const CensusSgmParameters& p, int threads = 1) {
  cv::Mat disparity;
  CensusSgm().compute(pair.left, pair.right, p, disparity, threads);
  return disparity;
}

std::string errorOf(const std::function<void()>& function) {
  try {
    function();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "no error";
}

TEST(CensusSgm, equalsTheReferenceForImagesOfAnySize) {
  RandomPairs pairs(1);
  Matchers matchers;
  // The rows around the blocks of 24 in which they are computed, and images narrower than the range.
  for (const int height : {1, 2, 23, 24, 25, 48, 49}) {
    for (const int width : {1, 2, 15, 16, 17, 40}) {
      for (const int min_disparity : {0, -9}) {
        CensusSgmParameters p = parametersOf(pairs.oneOf<int>({16, 32, 48}), min_disparity);
        matchers.expectReference(pairs.any({width, height}, p), p);
      }
    }
  }
  for (const cv::Size& size : {cv::Size(300, 1), cv::Size(200, 3), cv::Size(1, 150), cv::Size(3, 97)}) {
    const CensusSgmParameters p = parametersOf(64);
    matchers.expectReference(pairs.any(size, p), p);
  }
}

TEST(CensusSgm, equalsTheReferenceForAnyRange) {
  RandomPairs pairs(2);
  Matchers matchers;
  for (const int disparity_range :
       {1,  2,  3,   4,   15,  16,  17,  31,  32,  33,  48,  63,  64,  65,  80,
        96, 97, 112, 128, 129, 144, 160, 192, 200, 255, 256, 257, 272, 288, 300}) {
    const CensusSgmParameters p = parametersOf(disparity_range);
    for (const cv::Size& size : {cv::Size(disparity_range + 20, 6), cv::Size(24, 5)}) {
      matchers.expectReference(pairs.any(size, p), p);
      matchers.expectReference(pairs.noise(size, 3), p);
    }
  }
  for (const int disparity_range : {1024, 2047, 2048}) {
    const CensusSgmParameters p = parametersOf(disparity_range, -disparity_range / 2);
    matchers.expectReference(pairs.noise({13, 5}), p);
  }
  const CensusSgmParameters p = parametersOf(2048, 3);
  matchers.expectReference(pairs.noise({2200, 1}), p);
}

TEST(CensusSgm, equalsTheReferenceFromAnyMinDisparityOn) {
  RandomPairs pairs(3);
  Matchers matchers;
  for (const int min_disparity : {-2048, -100, -65, -64, -33, -7, -1, 1, 5, 40, 70, 2048}) {
    for (const int disparity_range : {16, 64}) {
      const CensusSgmParameters p = parametersOf(disparity_range, min_disparity);
      matchers.expectReference(pairs.any({70, 26}, p), p);
    }
  }
}

TEST(CensusSgm, equalsTheReferenceForRandomParameters) {
  RandomPairs pairs(4);
  Matchers matchers;
  for (int i = 0; i < 300 && !HasFailure(); ++i) {
    CensusSgmParameters p;
    p.disparity_range = pairs.oneOf<int>({pairs.number(1, 70), 16, 48, 64, 80, 128});
    p.min_disparity = pairs.oneOf<int>({0, 0, pairs.number(-40, 40)});
    p.p2 = pairs.oneOf<int>({0, 1, 50, 224, pairs.number(0, 225)});
    p.p1 = pairs.oneOf<int>({0, std::min(6, p.p2), p.p2, pairs.number(0, p.p2 + 1)});
    p.uniqueness_ratio = pairs.oneOf<int>({0, 1, 10, 50, 99});
    p.disp12_max_diff = pairs.oneOf<int>({-1, 0, 1, 5});
    p.aggregate_rows = pairs.number(0, 2) == 1;
    const cv::Size size(pairs.number(1, 70), pairs.number(1, 60));
    const StereoPair pair = pairs.any(size, p);
    matchers.expectReference(pair, p, pairs.number(1, 4));
  }
}

TEST(CensusSgm, equalsTheReferenceWhereAllSumsAreCut) {
  // Rows and columns that contradict each other: every disparity costs one of the paths a large step.
  RandomPairs pairs(5);
  Matchers matchers;
  int cut = 0;
  for (const int disparity_range : {4, 16, 48, 64, 80, 272}) {
    for (const int disp12_max_diff : {-1, 0, 254, 255, 256, 4096}) {
      CensusSgmParameters p = parametersOf(disparity_range, -disparity_range / 2);
      p.p1 = p.p2 = 224;
      p.disp12_max_diff = disp12_max_diff;
      const StereoPair pair = pairs.noise({40, 30});
      matchers.expectReference(pair, p);
      cut += cv::countNonZero(disparityOf(pair, p) == 0);
    }
  }
  EXPECT_GT(cut, 100);
}

TEST(CensusSgm, isTheSameForAnyNumberOfThreads) {
  RandomPairs pairs(6);
  const int threads_before = cv::getNumThreads();
  CensusSgmParameters p = parametersOf(48, -3);
  p.uniqueness_ratio = 5;
  for (const cv::Size& size : {cv::Size(90, 200), cv::Size(2, 100), cv::Size(120, 30)}) {
    p.aggregate_rows = !p.aggregate_rows;
    const StereoPair pair = pairs.any(size, p);
    const cv::Mat expected = straightforward::matchCensus(pair.left, pair.right, p);
    CensusSgm reused;
    for (const int opencv_threads : {1, 2, 3, 7}) {
      cv::setNumThreads(opencv_threads);
      for (const int threads : {1, 2, 3, 7, 1000}) {
        cv::Mat disparity;
        reused.compute(pair.left, pair.right, p, disparity, threads);
        EXPECT_TRUE(sameBits(disparity, expected)) << size << " " << opencv_threads << " " << threads;
      }
    }
  }
  cv::setNumThreads(threads_before);
}

TEST(CensusSgm, knowsOnlyTheirPartsOfLargerImages) {
  RandomPairs pairs(7);
  const CensusSgmParameters p = parametersOf(32);
  const StereoPair whole = pairs.textured({150, 80}, [](int x, int y) { return 4 + x / 20 + y / 10; });
  for (const cv::Rect& rect : {cv::Rect(20, 10, 100, 50), cv::Rect(1, 1, 33, 25), cv::Rect(149, 0, 1, 80)}) {
    const StereoPair part = whole.part(rect);
    const cv::Mat expected = disparityOf({part.left.clone(), part.right.clone()}, p);
    EXPECT_TRUE(sameBits(disparityOf(part, p), expected)) << rect;
  }
}

TEST(CensusSgm, writesIntoAMapOfItsTypeAndSize) {
  RandomPairs pairs(8);
  const CensusSgmParameters p = parametersOf(32);
  const StereoPair pair = pairs.any({100, 50}, p);
  cv::Mat whole(60, 110, CV_16SC1, cv::Scalar(-7));
  cv::Mat part = whole(cv::Rect(4, 3, 100, 50));
  const uchar* data = part.data;
  CensusSgm().compute(pair.left, pair.right, p, part);
  EXPECT_EQ(part.data, data);
  EXPECT_TRUE(sameBits(whole(cv::Rect(4, 3, 100, 50)), disparityOf(pair, p)));
  EXPECT_EQ(cv::countNonZero(whole == -7), 60 * 110 - 50 * 100);
}

TEST(CensusSgm, findsTheDisparityToAFractionOfAPixel) {
  // Half a pixel: the mean of two neighbours.
  RandomPairs pairs(9);
  StereoPair pair = pairs.textured({160, 60}, [](int, int) { return 0; });
  cv::GaussianBlur(pair.right, pair.right, cv::Size(7, 7), 1.5);
  const StereoPair shifted{pair.right.colRange(20, 140) * 0.5 + pair.right.colRange(19, 139) * 0.5,
                           pair.right.colRange(30, 150)};
  const cv::Mat disparity = disparityOf(shifted, parametersOf(32));
  const cv::Mat inside = disparity(cv::Rect(35, 8, 70, 44));
  EXPECT_GT(cv::countNonZero(inside != CensusSgm::INVALID), 0.95 * static_cast<double>(inside.total()));
  const double mean = cv::mean(inside, inside != CensusSgm::INVALID)[0] / CensusSgm::SUBPIXEL_STEPS;
  EXPECT_NEAR(mean, 10.5, 0.15);
}

TEST(CensusSgm, ofEqualSumsTheSmallestDisparityWinsUnlessItHasToBeUnique) {
  const StereoPair flat{cv::Mat(30, 50, CV_8UC1, cv::Scalar(80)), cv::Mat(30, 50, CV_8UC1, cv::Scalar(80))};
  CensusSgmParameters p = parametersOf(16);
  p.p1 = p.p2 = 0;
  EXPECT_EQ(cv::countNonZero(disparityOf(flat, p)), 0);
  p.uniqueness_ratio = 1;
  const cv::Mat disparity = disparityOf(flat, p);
  EXPECT_EQ(cv::countNonZero(disparity.colRange(0, 3)), 0)
      << "1 is next to 0, and 2 leads out of the image there or in the column before";
  EXPECT_EQ(cv::countNonZero(disparity.colRange(3, 50) != CensusSgm::INVALID), 0);
}

TEST(CensusSgm, neighboursOfTheBestDisparityDoNotMakeItAmbiguous) {
  RandomPairs pairs(10);
  Matchers matchers;
  for (const int disparity_range : {1, 2, 3, 4}) {
    CensusSgmParameters p = parametersOf(disparity_range);
    p.disp12_max_diff = -1;
    p.uniqueness_ratio = 99;
    const StereoPair pair = pairs.noise({60, 25});
    matchers.expectReference(pair, p);
    if (disparity_range <= 2) {
      EXPECT_EQ(cv::countNonZero(disparityOf(pair, p).colRange(2, 60) < 0), 0);
    }
  }
}

TEST(CensusSgm, errorsNameWhatIsWrong) {
  const cv::Mat gray(60, 100, CV_8UC1, cv::Scalar(0));
  CensusSgm matcher;
  cv::Mat disparity;
  const auto error = [&](const cv::Mat& left, const cv::Mat& right) {
    return errorOf([&] { matcher.compute(left, right, {}, disparity); });
  };
  EXPECT_EQ(error(cv::Mat(), gray), "left is CV_8UC1 of 0x0, expected CV_8UC1 of 0x0, not empty");
  EXPECT_EQ(error(gray, cv::Mat()), "right is CV_8UC1 of 0x0, expected CV_8UC1 of 100x60, not empty");
  EXPECT_EQ(error(cv::Mat(60, 100, CV_16UC1), gray),
            "left is CV_16UC1 of 100x60, expected CV_8UC1 of 100x60, not empty");
  EXPECT_EQ(error(gray, gray.rowRange(0, 59)),
            "right is CV_8UC1 of 100x59, expected CV_8UC1 of 100x60, not empty");
  EXPECT_EQ(errorOf([&] { matcher.compute(gray, gray, {}, disparity, 0); }),
            "threads is 0, expected at least 1");
  EXPECT_EQ(errorOf([&] { matcher.compute(gray, gray, parametersOf(0), disparity); }),
            "disparity_range is 0, expected 1...2048");
  EXPECT_TRUE(disparity.empty());
}

TEST(CensusSgmParameters, limits) {
  struct Limits {
    const char* name;
    int CensusSgmParameters::*member;
    std::vector<int> good, bad;
    const char* expected;
  };
  const std::vector<Limits> limits = {
      {"min_disparity", &CensusSgmParameters::min_disparity, {-2048, 2048}, {-2049, 2049}, "-2048...2048"},
      {"disparity_range", &CensusSgmParameters::disparity_range, {1, 2048}, {-1, 0, 2049}, "1...2048"},
      {"P1", &CensusSgmParameters::p1, {0, 50}, {-1, 51}, "0...P2"},
      {"P2", &CensusSgmParameters::p2, {6, 224}, {-1, 225}, "0...224"},
      {"uniqueness_ratio", &CensusSgmParameters::uniqueness_ratio, {0, 99}, {-1, 100}, "0...99"},
      {"disp12_max_diff", &CensusSgmParameters::disp12_max_diff, {-100, -1, 0, 100000}, {}, ""}};
  EXPECT_NO_THROW(validate(CensusSgmParameters()));
  for (const Limits& limit : limits) {
    CensusSgmParameters p;
    for (const int value : limit.good) {
      p.*limit.member = value;
      EXPECT_NO_THROW(validate(p)) << limit.name << " " << value;
    }
    for (const int value : limit.bad) {
      p.*limit.member = value;
      EXPECT_EQ(errorOf([&p] { validate(p); }),
                std::string(limit.name) + " is " + std::to_string(value) + ", expected " + limit.expected);
    }
  }
  CensusSgmParameters p;
  p.p1 = p.p2 = 0;
  EXPECT_NO_THROW(validate(p));
}

}  // namespace
}  // namespace disparity_refinement
