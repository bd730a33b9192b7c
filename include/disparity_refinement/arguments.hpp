#pragma once

#include <cstddef>
#include <functional>
#include <opencv2/core.hpp>
#include <sstream>
#include <stdexcept>
#include <string>

namespace disparity_refinement {

/// Throws std::invalid_argument "<name> is <value>, expected <expected>" unless the condition holds. Nothing
/// is allocated if it does, as far as the arguments need no allocation themselves.
template <typename Name, typename Value, typename Expected>
void requireArgument(bool condition, const Name& name, const Value& value, const Expected& expected) {
  if (condition) return;
  std::ostringstream message;
  message << name << " is " << value << ", expected " << expected;
  throw std::invalid_argument(message.str());
}

/// "CV_32FC1 of 1242x375"
inline std::string describeImage(int type, const cv::Size& size) {
  return cv::typeToString(type) + " of " + std::to_string(size.width) + "x" + std::to_string(size.height);
}

/// Throws std::invalid_argument unless the image has this type and size and is not empty.
inline void requireImage(const cv::Mat& image, const char* name, int type, const cv::Size& size) {
  const cv::Size actual(image.cols, image.rows);
  if (image.dims == 2 && !image.empty() && image.type() == type && actual == size) return;
  requireArgument(false, name, describeImage(image.type(), actual),
                  describeImage(type, size) + ", not empty");
}

/// The same for an image of any size.
inline void requireImage(const cv::Mat& image, const char* name, int type) {
  requireImage(image, name, type, cv::Size(image.cols, image.rows));
}

/// Throws std::invalid_argument unless the image has labels of this size, all less than the number of planes.
inline void requireLabels(const cv::Mat& labels, const cv::Size& size, std::size_t planes) {
  requireImage(labels, "labels", CV_32SC1, size);
  double largest = 0.0;
  cv::minMaxLoc(labels, nullptr, &largest);
  requireArgument(largest < static_cast<double>(planes), "the largest label", largest,
                  "less than the number of planes, " + std::to_string(planes));
}

/// Whether the bytes from the first to the last pixel of two images meet.
inline bool overlap(const cv::Mat& a, const cv::Mat& b) {
  if (a.empty() || b.empty()) return false;
  const auto end = [](const cv::Mat& image) {
    return image.ptr(image.rows - 1) + image.cols * image.elemSize();
  };
  const std::less<const uchar*> before;
  return before(a.data, end(b)) && before(b.data, end(a));
}

}  // namespace disparity_refinement
