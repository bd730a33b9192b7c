#pragma once

#include <fuzzer/FuzzedDataProvider.h>
#include <sanitizer/asan_interface.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "disparity_refinement/DisparityRange.hpp"

/// What the harnesses share: an input's bytes as numbers, images and texts, and what becomes of a broken
/// promise.
namespace disparity_refinement {
namespace fuzz {

/// Ends the process unless a promise is kept; libFuzzer then keeps the input.
inline void require(bool is_kept, const char* promise) {
  if (is_kept) return;
  std::fprintf(stderr, "broken promise: %s\n", promise);
  std::abort();
}

/// Whether `work` returns. It may throw the documented exception with a message that holds a text; any other
/// exception is a finding.
template <typename Documented = std::invalid_argument, typename Work>
bool succeeds(const Work& work, const std::string& text = "") {
  try {
    work();
    return true;
  } catch (const Documented& error) {
    const std::string message = error.what();
    const bool is_named = !message.empty() && message.find(text.c_str()) != std::string::npos;
    if (!is_named)
      std::fprintf(stderr, "the error \"%s\" does not name \"%s\"\n", error.what(), text.c_str());
    require(is_named, "an error names its cause");
    return false;
  }
}

/// Bit for bit.
inline bool same(const cv::Mat& a, const cv::Mat& b) {
  if (a.size != b.size || a.type() != b.type()) return false;
  for (int y = 0; y < a.rows; ++y) {
    if (std::memcmp(a.ptr(y), b.ptr(y), a.cols * a.elemSize()) != 0) return false;
  }
  return true;
}

/// OpenCV's threads until the end of the scope.
class Threads {
 public:
  explicit Threads(int threads) { cv::setNumThreads(threads); }
  ~Threads() { cv::setNumThreads(1); }
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;
};

/// An image in memory that ends with its last pixel. Between its rows there may be memory that nobody may
/// touch.
class Picture {
 public:
  Picture(const cv::Size& size, int type, int gap) : mat_() {
    if (size.empty()) return;
    const std::size_t row = static_cast<std::size_t>(size.width) * CV_ELEM_SIZE(type);
    const std::size_t step = row + static_cast<std::size_t>(gap) * CV_ELEM_SIZE(type);
    memory_.reset(new std::uint8_t[step * (size.height - 1) + row]());
    mat_ = cv::Mat(size, type, memory_.get(), step);
    for (int y = 0; y + 1 < size.height; ++y) ASAN_POISON_MEMORY_REGION(mat_.ptr(y) + row, step - row);
  }
  Picture(Picture&&) = default;
  Picture& operator=(Picture&&) = default;

  cv::Mat& mat() { return mat_; }
  const cv::Mat& mat() const { return mat_; }

 private:
  std::unique_ptr<std::uint8_t[]> memory_;
  cv::Mat mat_;
};

class Input {
 public:
  Input(const std::uint8_t* bytes, std::size_t size) : bytes_(bytes, size), is_wild_(oneIn(4)) {}

  FuzzedDataProvider& bytes() { return bytes_; }

  /// Whether this input breaks rules that are checked.
  bool isWild() const { return is_wild_; }
  bool yes() { return bytes_.ConsumeBool(); }
  bool oneIn(int n) { return bytes_.ConsumeIntegralInRange(1, n) == 1; }

  int number(int least, int most) { return bytes_.ConsumeIntegralInRange(least, most); }

  template <typename T>
  T oneOf(std::initializer_list<T> values) {
    return values.begin()[number(0, static_cast<int>(values.size()) - 1)];
  }

  /// As a command line or a message's string may hold it: without NUL.
  std::string text(int most) {
    std::string text = bytes_.ConsumeRandomLengthString(static_cast<std::size_t>(most));
    text.erase(std::remove(text.begin(), text.end(), '\0'), text.end());
    return text;
  }

  /// In a range, at its ends more often; outside of it now and then if the input is wild.
  int parameter(int least, int most) {
    if (is_wild_ && oneIn(8)) {
      if (yes()) return bytes_.ConsumeIntegral<int>();
      return yes() ? least - 1 : most + 1;
    }
    return oneIn(8) ? oneOf({least, most}) : number(least, most);
  }

  double parameter(double least, double most) {
    if (is_wild_ && oneIn(8)) return anyNumber<double>();
    return oneIn(8) ? oneOf({least, most}) : bytes_.ConsumeFloatingPointInRange(least, most);
  }

  template <typename Enumeration>
  Enumeration enumeration(int least, int most) {
    return static_cast<Enumeration>(parameter(least, most));
  }

  /// NaN, infinity, what is denormal, tiny or huge too.
  template <typename T>
  T anyNumber() {
    using Limits = std::numeric_limits<T>;
    switch (number(0, 3)) {
      case 0:
        return oneOf({T{0}, -T{0}, T{1}, T{-1}, Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(),
                      Limits::max(), Limits::lowest(), Limits::min(), Limits::denorm_min(),
                      Limits::epsilon()});
      case 1:
        return static_cast<T>(number(-4096, 4096));
      case 2:
        return static_cast<T>(std::ldexp(number(-255, 255), number(-160, 160)));
      default: {
        T value{};
        if (bytes_.ConsumeData(&value, sizeof value) < sizeof value) value = T{3};
        return value;
      }
    }
  }

  /// One row, one column or one pixel more often than others, never empty.
  cv::Size size(int most_columns, int most_rows) {
    const int columns = oneIn(8) ? 1 : number(1, most_columns);
    return {columns, oneIn(8) ? 1 : number(1, most_rows)};
  }

  /// Zeros. If the input is wild, now and then of another type or size, or empty.
  Picture picture(cv::Size size, int type) {
    if (is_wild_ && oneIn(12)) {
      if (oneIn(3))
        size = oneOf({cv::Size(), cv::Size(size.width + 1, size.height), cv::Size(size.height, size.width)});
      if (oneIn(2))
        type = oneOf({CV_8UC1, CV_8UC3, CV_16UC1, CV_16SC1, CV_32SC1, CV_32FC1, CV_64FC1, CV_32FC2});
    }
    return Picture(size, type, oneIn(3) ? number(1, 20) : 0);
  }

  Picture gray(const cv::Size& size) {
    Picture picture = this->picture(size, CV_8UC1);
    fillGray(picture.mat());
    return picture;
  }

  /// Disparities about a range, with holes.
  Picture disparity(const cv::Size& size, const DisparityRange& range) {
    Picture picture = this->picture(size, CV_32FC1);
    if (picture.mat().type() == CV_32FC1) fillDisparity(picture.mat(), range);
    return picture;
  }

  /// Labels 0 ... n - 1, mostly; negative, sparse or too large ones too.
  Picture labels(const cv::Size& size) {
    Picture picture = this->picture(size, CV_32SC1);
    if (picture.mat().type() == CV_32SC1) fillLabels(picture.mat());
    return picture;
  }

  /// Of any type; gray values where a pixel is a byte.
  void fillGray(cv::Mat& image) {
    const int kind = number(0, 4), low = number(0, 255), high = number(low, 255), side = number(1, 9);
    seed_ = bytes_.ConsumeIntegral<std::uint32_t>();
    const int row = static_cast<int>(image.cols * image.elemSize());
    for (int y = 0; y < image.rows; ++y) {
      std::uint8_t* values = image.ptr(y);
      if (kind == 0) {
        bytes_.ConsumeData(values, static_cast<std::size_t>(row));
        continue;
      }
      for (int x = 0; x < row; ++x) {
        int value = low;
        if (kind == 1) value = low + static_cast<int>(random() % (high - low + 1));
        if (kind == 2) value = (x / side + y / side) % 2 == 0 ? low : high;
        if (kind == 3) value = low + x * side + y * (high - low);
        values[x] = static_cast<std::uint8_t>(value);
      }
    }
  }

  /// Finite, and such that range.invalid() is less than the least disparity; anything if the input is wild.
  DisparityRange range() {
    DisparityRange range;
    if (is_wild_ && oneIn(6)) {
      range.min = anyNumber<float>();
      range.max = anyNumber<float>();
    } else {
      range.min = static_cast<float>(number(-2048, 2048)) + oneOf({0.0F, 0.0F, 0.25F, 0.3F, -1.0F / 3.0F});
      range.max = range.min + static_cast<float>(oneOf({0, 1, 16, 64, 128, 2048}));
      if (oneIn(4)) range.max += oneOf({0.04F, 0.1F, 1.0F / 3.0F, 1e6F});
    }
    return range;
  }

 private:
  std::uint64_t random() {
    seed_ = seed_ * 6364136223846793005U + 1442695040888963407U;
    return seed_ >> 33;
  }

  float noise(float size) { return size * (static_cast<float>(random() % 2001) / 1000.0F - 1.0F); }

  void fillDisparity(cv::Mat& map, const DisparityRange& range) {
    const int kind = number(0, 3), holes = number(0, 100);
    const float a = static_cast<float>(number(-100, 100)) / 50.0F,
                b = static_cast<float>(number(-100, 100)) / 50.0F;
    const float middle = 0.5F * range.min + 0.5F * range.max, jitter = oneOf({0.0F, 0.1F, 1.0F, 20.0F});
    float specials[4];
    for (float& special : specials) special = anyNumber<float>();
    seed_ = bytes_.ConsumeIntegral<std::uint32_t>();
    for (int y = 0; y < map.rows; ++y) {
      float* row = map.ptr<float>(y);
      for (int x = 0; x < map.cols; ++x) {
        float d =
            middle + a * static_cast<float>(x - map.cols / 2) + b * static_cast<float>(y - map.rows / 2);
        if (kind == 1) d = x < map.cols / 2 ? range.min : middle;
        d += noise(jitter);
        if (kind == 2) d = std::round(d * 16.0F) / 16.0F;
        if (kind == 3 && random() % 4 == 0) d = specials[random() % 4];
        if (random() % 100 < static_cast<std::uint64_t>(holes)) d = range.min - 1.0F;
        row[x] = d;
      }
    }
    if (oneIn(4) && !map.empty())
      map.at<float>(number(0, map.rows - 1), number(0, map.cols - 1)) = anyNumber<float>();
  }

  void fillLabels(cv::Mat& map) {
    const int kind = number(0, 4), side = number(1, 16), columns = map.cols / side + 1;
    const int pixels = std::max(1, static_cast<int>(map.total()));
    seed_ = bytes_.ConsumeIntegral<std::uint32_t>();
    for (int y = 0; y < map.rows; ++y) {
      int* row = map.ptr<int>(y);
      for (int x = 0; x < map.cols; ++x) {
        row[x] = y / side * columns + x / side;
        if (kind == 1) row[x] = static_cast<int>(random() % static_cast<std::uint64_t>(pixels));
        if (kind == 2) row[x] = static_cast<int>(random() % 3) - 1;
        if (kind == 3) row[x] = (x / side + y / side) % 2 == 0 ? -1 : pixels - 1;
        if (kind == 4) row[x] = 0;
        if (row[x] >= pixels) row[x] = pixels - 1;
      }
    }
    if (is_wild_ && oneIn(4) && !map.empty()) {
      map.at<int>(number(0, map.rows - 1), number(0, map.cols - 1)) = bytes_.ConsumeIntegral<int>();
    }
  }

  FuzzedDataProvider bytes_;
  bool is_wild_;
  std::uint64_t seed_ = 0;
};

/// What a harness does with an input: each defines it.
void test(Input& input);

}  // namespace fuzz
}  // namespace disparity_refinement
