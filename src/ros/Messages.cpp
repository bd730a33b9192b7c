#include "disparity_refinement/ros/Messages.hpp"

#include <sensor_msgs/image_encodings.h>

#include <boost/make_shared.hpp>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace disparity_refinement {
namespace {

namespace enc = sensor_msgs::image_encodings;

template <class... Parts>
[[noreturn]] void refuse(const std::string& topic, const Parts&... parts) {
  std::ostringstream text;
  text << topic << ": ";
  (text << ... << parts);
  throw std::invalid_argument(text.str());
}

/// Size, step and amount of data of an image of `bytes_per_pixel`.
void checkLayout(const sensor_msgs::Image& message, int bytes_per_pixel, const std::string& topic) {
  if (message.width == 0 || message.height == 0) {
    refuse(topic, "the image is empty (", message.width, "x", message.height, ")");
  }
  const std::size_t row = static_cast<std::size_t>(message.width) * bytes_per_pixel;
  if (message.step < row) {
    refuse(topic, "step is ", message.step, " bytes, expected at least ", row, " for a width of ",
           message.width, " in ", message.encoding);
  }
  const std::size_t expected = static_cast<std::size_t>(message.step) * message.height;
  if (message.data.size() < expected) {
    refuse(topic, "the image has ", message.data.size(), " bytes, expected ", expected, " (step ",
           message.step, " * height ", message.height, ")");
  }
}

/// cv_bridge would build a regular expression for every image.
int typeOf(const std::string& encoding) {
  if (encoding == enc::TYPE_32FC1) return CV_32FC1;
  if (encoding == enc::TYPE_32SC1) return CV_32SC1;
  return cv_bridge::getCvType(encoding);
}

bool isBigEndianMachine() {
  const std::uint16_t probe = 1;
  return *reinterpret_cast<const std::uint8_t*>(&probe) == 0;
}

/// Infinity is no disparity either, so only finite values count.
bool isFiniteAbove(float value, float bound) {
  return (value > bound) & (value <= std::numeric_limits<float>::max());
}

bool hasFiniteAbove(const cv::Mat& map, float bound) {
  unsigned found = 0;
  for (int y = 0; y < map.rows; ++y) {
    const auto* row = map.ptr<float>(y);
    for (int x = 0; x < map.cols; ++x) found |= isFiniteAbove(row[x], bound) ? 1U : 0U;
  }
  return found != 0;
}

float largestFinite(const cv::Mat& map, float at_least) {
  float largest = at_least;
  for (int y = 0; y < map.rows; ++y) {
    const auto* row = map.ptr<float>(y);
    for (int x = 0; x < map.cols; ++x) {
      if (isFiniteAbove(row[x], largest)) largest = row[x];
    }
  }
  return largest;
}

}  // namespace

void requireTime(const std_msgs::Header& header, const std::string& topic) {
  constexpr std::uint32_t LATEST = std::numeric_limits<std::int32_t>::max();
  if (header.stamp.isZero() || header.stamp.sec > LATEST) {
    refuse(topic, "the stamp is ", header.stamp.isZero() ? "0" : "beyond the year 2038",
           ", expected the time of exposure: the driver has to fill in header.stamp");
  }
}

cv_bridge::CvImageConstPtr grayImage(const sensor_msgs::ImageConstPtr& message, const std::string& topic) {
  int channels = 0, bits = 0;
  try {
    bits = enc::bitDepth(message->encoding);
    channels = enc::numChannels(message->encoding);
  } catch (const std::exception&) {
    // Refused below.
  }
  // 8UC-1 and 8UC999999999 are taken for encodings there.
  if (channels < 1 || channels > CV_CN_MAX) {
    refuse(topic, "unknown encoding '", message->encoding,
           "', expected mono8, mono16, bgr8, rgb8, bgra8, rgba8 or a Bayer pattern");
  }
  checkLayout(*message, channels * bits / 8, topic);

  const bool is_gray = message->encoding == enc::MONO8 || message->encoding == enc::TYPE_8UC1;
  cv_bridge::CvImageConstPtr gray;
  try {
    gray = cv_bridge::toCvShare(message, is_gray ? message->encoding : enc::MONO8);
  } catch (const std::exception& e) {
    refuse(topic, "cannot convert encoding '", message->encoding, "' to mono8: ", e.what());
  }
  // cv_bridge leaves 8SC1 as it is.
  if (gray->image.type() != CV_8UC1) {
    refuse(topic, "cannot convert encoding '", message->encoding, "' to mono8: it is no colour format");
  }
  return gray;
}

sensor_msgs::ImagePtr makeImage(const std_msgs::Header& header, const cv::Size& size,
                                const std::string& encoding) {
  const auto image = boost::make_shared<sensor_msgs::Image>();
  image->header = header;
  image->width = static_cast<std::uint32_t>(size.width);
  image->height = static_cast<std::uint32_t>(size.height);
  image->encoding = encoding;
  image->is_bigendian = isBigEndianMachine() ? 1 : 0;
  image->step = image->width * static_cast<std::uint32_t>(CV_ELEM_SIZE(typeOf(encoding)));
  image->data.resize(static_cast<std::size_t>(image->step) * image->height);
  return image;
}

cv::Mat imageView(const sensor_msgs::Image& message, const std::string& encoding, const std::string& topic) {
  if (message.encoding != encoding) {
    refuse(topic, "encoding is '", message.encoding, "', expected ", encoding);
  }
  const int type = typeOf(encoding);
  const int element_size = CV_ELEM_SIZE1(type);
  checkLayout(message, CV_ELEM_SIZE(type), topic);
  if (element_size > 1 && (message.is_bigendian != 0) != isBigEndianMachine()) {
    refuse(topic, "is_bigendian is ", static_cast<int>(message.is_bigendian),
           ", not the byte order of this machine");
  }
  if (message.step % element_size != 0) {
    refuse(topic, "step is ", message.step, " bytes, expected a multiple of ", element_size);
  }
  return cv::Mat(static_cast<int>(message.height), static_cast<int>(message.width), type,
                 const_cast<std::uint8_t*>(message.data.data()), message.step);
}

stereo_msgs::DisparityImagePtr makeDisparityImage(const std_msgs::Header& header, const cv::Size& size,
                                                  const StereoGeometry& geometry, const DisparityRange& range,
                                                  const cv::Rect& valid_window) {
  const auto message = boost::make_shared<stereo_msgs::DisparityImage>();
  message->header = header;
  message->image = std::move(*makeImage(header, size, enc::TYPE_32FC1));
  message->f = static_cast<float>(geometry.focal_length);
  message->T = static_cast<float>(geometry.baseline);
  message->min_disparity = range.min;
  message->max_disparity = range.max;
  message->delta_d = 1.0F / 16.0F;
  message->valid_window.x_offset = static_cast<std::uint32_t>(valid_window.x);
  message->valid_window.y_offset = static_cast<std::uint32_t>(valid_window.y);
  message->valid_window.width = static_cast<std::uint32_t>(valid_window.width);
  message->valid_window.height = static_cast<std::uint32_t>(valid_window.height);
  return message;
}

DisparityRange disparityRange(const stereo_msgs::DisparityImage& message, const std::string& topic) {
  if (!std::isfinite(message.min_disparity) || !(message.min_disparity - 1.0F < message.min_disparity)) {
    refuse(topic, "min_disparity is ", message.min_disparity,
           ", expected a finite value, of less than 2^24 in size");
  }
  const cv::Mat map = imageView(message.image, enc::TYPE_32FC1, topic);
  DisparityRange range;
  range.min = message.min_disparity;
  range.max = message.max_disparity;
  if (std::isfinite(range.max) && range.max > range.min && !hasFiniteAbove(map, range.max)) return range;
  range.max = std::floor(largestFinite(map, range.min)) + 1.0F;
  return range;
}

StereoGeometry disparityGeometry(const stereo_msgs::DisparityImage& message, const std::string& topic) {
  if (!(message.f > 0.0F) || !(message.T > 0.0F) || !std::isfinite(message.f) || !std::isfinite(message.T)) {
    refuse(topic, "f is ", message.f, " px and T is ", message.T, " m, expected positive numbers");
  }
  StereoGeometry geometry;
  geometry.focal_length = message.f;
  geometry.baseline = message.T;
  return geometry;
}

sensor_msgs::ImagePtr depthImage(const std_msgs::Header& header, const cv::Mat& disparity,
                                 const DisparityRange& range, const StereoGeometry& geometry) {
  auto message = makeImage(header, disparity.size(), enc::TYPE_32FC1);
  cv::Mat depth = imageView(*message, enc::TYPE_32FC1, "depth");
  const auto f_times_t = static_cast<float>(geometry.focal_length * geometry.baseline);
  for (int y = 0; y < disparity.rows; ++y) {
    const auto* d = disparity.ptr<float>(y);
    auto* z = depth.ptr<float>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      const bool is_known = range.isValid(d[x]) && d[x] > 0.0F;
      z[x] = is_known ? f_times_t / d[x] : std::numeric_limits<float>::quiet_NaN();
    }
  }
  return message;
}

void publishParameters(const ros::Publisher& publisher, const std_msgs::Header& header,
                       const dynamic_reconfigure::Config& parameters) {
  if (publisher.getNumSubscribers() == 0) return;
  const auto message = boost::make_shared<FrameParameters>();
  message->header = header;
  message->parameters = parameters;
  publisher.publish(message);
}

PlanesPtr planesMessage(const std_msgs::Header& header, const std::vector<SegmentPlane>& planes) {
  auto message = boost::make_shared<Planes>();
  message->header = header;
  message->planes.resize(planes.size());
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const SegmentPlane& plane = planes[i];
    Plane& out = message->planes[i];
    out.status = static_cast<std::uint8_t>(plane.status);
    out.a = plane.a;
    out.b = plane.b;
    out.c = plane.c;
    out.pixels = static_cast<std::uint32_t>(plane.pixels);
    out.valid = static_cast<std::uint32_t>(plane.valid);
    out.inliers = static_cast<std::uint32_t>(plane.inliers);
    out.iterations = static_cast<std::uint32_t>(plane.iterations);
  }
  return message;
}

std::vector<SegmentPlane> segmentPlanes(const Planes& message, const std::string& topic) {
  std::vector<SegmentPlane> planes(message.planes.size());
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const Plane& in = message.planes[i];
    if (in.status > Plane::OF_NEIGHBOUR) {
      refuse(topic, "the status of plane ", i, " is ", static_cast<int>(in.status),
             ", expected one of Plane.msg, 0 to ", static_cast<int>(Plane::OF_NEIGHBOUR));
    }
    SegmentPlane& plane = planes[i];
    plane.status = static_cast<PlaneStatus>(in.status);
    plane.a = in.a;
    plane.b = in.b;
    plane.c = in.c;
    plane.pixels = static_cast<int>(in.pixels);
    plane.valid = static_cast<int>(in.valid);
    plane.inliers = static_cast<int>(in.inliers);
    plane.iterations = static_cast<int>(in.iterations);
  }
  return planes;
}

}  // namespace disparity_refinement
