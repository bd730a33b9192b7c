#include <gtest/gtest.h>
#include <sensor_msgs/image_encodings.h>

#include <boost/make_shared.hpp>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "disparity_refinement/ros/Messages.hpp"

namespace disparity_refinement {
namespace {

namespace enc = sensor_msgs::image_encodings;

const float NOT_A_NUMBER = std::numeric_limits<float>::quiet_NaN();
const float INFINITE = std::numeric_limits<float>::infinity();

sensor_msgs::ImagePtr image(const std::string& encoding, const cv::Mat& pixels) {
  return cv_bridge::CvImage(std_msgs::Header(), encoding, pixels).toImageMsg();
}

/// What the exception says, empty without one.
std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "";
}

#define EXPECT_REFUSED(call, word1, word2)                  \
  do {                                                      \
    const std::string text = refusal([&] { call; });        \
    EXPECT_NE(text.find(word1), std::string::npos) << text; \
    EXPECT_NE(text.find(word2), std::string::npos) << text; \
  } while (false)

TEST(RequireTime, refusesWhatIsNoTimeOfExposure) {
  std_msgs::Header header;
  EXPECT_REFUSED(requireTime(header, "/left"), "/left: the stamp is 0, ", "expected the time of exposure");
  // The last one that is no more than ros::Duration can span from any other.
  header.stamp = ros::Time(2147483647U, 999999999U);
  EXPECT_NO_THROW(requireTime(header, "/left"));
  header.stamp.sec += 1;
  EXPECT_REFUSED(requireTime(header, "/left"), "/left: the stamp is beyond", "expected the time of exposure");
  header.stamp = ros::TIME_MIN;
  EXPECT_NO_THROW(requireTime(header, "/left"));
}

TEST(GrayImage, sharesTheMemoryOfGrayImages) {
  for (const std::string& encoding : {enc::MONO8, enc::TYPE_8UC1}) {
    const auto message = image(encoding, cv::Mat(3, 5, CV_8UC1, cv::Scalar(7)));
    const auto gray = grayImage(message, "left");
    EXPECT_EQ(gray->image.data, message->data.data()) << encoding;
    EXPECT_EQ(gray->image.size(), cv::Size(5, 3)) << encoding;
    EXPECT_EQ(gray->image.type(), CV_8UC1) << encoding;
  }
}

TEST(GrayImage, takesPaddedRows) {
  const auto message = boost::make_shared<sensor_msgs::Image>();
  message->encoding = enc::MONO8;
  message->width = 2;
  message->height = 2;
  message->step = 4;
  message->data = {1, 2, 99, 99, 3, 4, 99, 99};
  const cv::Mat gray = grayImage(message, "left")->image;
  const cv::Mat expected = (cv::Mat_<std::uint8_t>(2, 2) << 1, 2, 3, 4);
  EXPECT_EQ(cv::norm(gray, expected, cv::NORM_INF), 0.0);
}

TEST(GrayImage, convertsColour) {
  // 0.299 * 200 + 0.587 * 100 + 0.114 * 50 = 124.2
  const struct {
    std::string encoding;
    int type;
    cv::Scalar colour;
  } cases[] = {{enc::BGR8, CV_8UC3, {50, 100, 200}},
               {enc::RGB8, CV_8UC3, {200, 100, 50}},
               {enc::BGRA8, CV_8UC4, {50, 100, 200, 255}},
               {enc::RGBA8, CV_8UC4, {200, 100, 50, 255}}};
  for (const auto& c : cases) {
    const cv::Mat gray = grayImage(image(c.encoding, cv::Mat(4, 6, c.type, c.colour)), "left")->image;
    ASSERT_EQ(gray.type(), CV_8UC1) << c.encoding;
    EXPECT_EQ(cv::norm(gray, cv::Mat(4, 6, CV_8UC1, cv::Scalar(124)), cv::NORM_INF), 0.0) << c.encoding;
  }
}

TEST(GrayImage, convertsSixteenBits) {
  // 0...65535 becomes 0...255.
  const cv::Mat pixels = (cv::Mat_<std::uint16_t>(1, 4) << 0, 257, 25700, 65535);
  const cv::Mat expected = (cv::Mat_<std::uint8_t>(1, 4) << 0, 1, 100, 255);
  const cv::Mat gray = grayImage(image(enc::MONO16, pixels), "left")->image;
  ASSERT_EQ(gray.type(), CV_8UC1);
  EXPECT_EQ(cv::norm(gray, expected, cv::NORM_INF), 0.0);
}

TEST(GrayImage, convertsBayer) {
  // The pattern of the encoding names the colours of the first two rows.
  for (const std::string& encoding :
       {enc::BAYER_RGGB8, enc::BAYER_BGGR8, enc::BAYER_GBRG8, enc::BAYER_GRBG8}) {
    const std::string pattern = encoding.substr(std::string("bayer_").size(), 4);
    cv::Mat mosaic(8, 8, CV_8UC1);
    for (int y = 0; y < mosaic.rows; ++y) {
      for (int x = 0; x < mosaic.cols; ++x) {
        const char colour = pattern[(y % 2) * 2 + x % 2];
        mosaic.at<std::uint8_t>(y, x) = colour == 'r' ? 200 : colour == 'g' ? 100 : 50;
      }
    }
    const cv::Mat gray = grayImage(image(encoding, mosaic), "left")->image;
    ASSERT_EQ(gray.type(), CV_8UC1) << encoding;
    EXPECT_LE(cv::norm(gray, cv::Mat(8, 8, CV_8UC1, cv::Scalar(124)), cv::NORM_INF), 1.0) << encoding;
  }
}

TEST(GrayImage, refusesWhatItCannotRead) {
  const cv::Mat pixels(3, 5, CV_8UC1, cv::Scalar(7));
  auto message = image(enc::MONO8, pixels);
  message->encoding = "yuv999";
  EXPECT_REFUSED(grayImage(message, "left"), "left: ", "'yuv999'");
  EXPECT_REFUSED(grayImage(image(enc::TYPE_32FC1, cv::Mat(3, 5, CV_32FC1, cv::Scalar(1))), "left"),
                 "left: ", "'32FC1'");

  EXPECT_REFUSED(grayImage(boost::make_shared<sensor_msgs::Image>(), "left"), "left: ", "encoding ''");
  for (const std::string encoding : {"64FC999999999", "8UC-1", "8UC513"}) {
    message->encoding = encoding;
    EXPECT_REFUSED(grayImage(message, "left"), "left: ", "unknown encoding '" + encoding + "'");
  }
  // cv_bridge passes it on as signed values.
  EXPECT_REFUSED(grayImage(image(enc::TYPE_8SC1, cv::Mat(3, 5, CV_8SC1, cv::Scalar(1))), "left"),
                 "left: ", "'8SC1'");
  message = image(enc::MONO8, pixels);
  message->width = 0;
  EXPECT_REFUSED(grayImage(message, "left"), "left: ", "empty (0x3)");
  message = image(enc::MONO8, pixels);
  message->step = 4;
  EXPECT_REFUSED(grayImage(message, "left"), "left: ", "step is 4 bytes, expected at least 5");
  message = image(enc::MONO8, pixels);
  message->data.pop_back();
  EXPECT_REFUSED(grayImage(message, "left"), "left: ", "14 bytes, expected 15");
  message = image(enc::BGR8, cv::Mat(3, 5, CV_8UC3, cv::Scalar(1, 2, 3)));
  message->step = 5;
  EXPECT_REFUSED(grayImage(message, "left"), "left: ", "step is 5 bytes, expected at least 15");
}

TEST(ImageView, sharesTheMemoryOfTheMessage) {
  const auto message = makeImage(std_msgs::Header(), {5, 3}, enc::TYPE_32FC1);
  cv::Mat view = imageView(*message, enc::TYPE_32FC1, "disparity");
  EXPECT_EQ(view.size(), cv::Size(5, 3));
  EXPECT_EQ(view.type(), CV_32FC1);
  EXPECT_EQ(view.data, message->data.data());
  view.at<float>(2, 4) = 1.5F;
  float last = 0.0F;
  std::memcpy(&last, message->data.data() + 14 * sizeof(float), sizeof(float));
  EXPECT_EQ(last, 1.5F);
}

TEST(ImageView, followsTheStep) {
  const auto message = makeImage(std_msgs::Header(), {2, 2}, enc::TYPE_32SC1);
  message->step = 12;
  message->data.assign(24, 0);
  message->data[12 + 4] = 9;
  message->is_bigendian = 0;
  EXPECT_EQ(imageView(*message, enc::TYPE_32SC1, "labels").at<int>(1, 1), 9);
}

TEST(ImageView, refusesAnythingElse) {
  const auto make = [] { return makeImage(std_msgs::Header(), {5, 3}, enc::TYPE_32FC1); };
  auto message = make();
  message->encoding = enc::TYPE_16UC1;
  EXPECT_REFUSED(imageView(*message, enc::TYPE_32FC1, "disparity"), "disparity: ", "'16UC1', expected 32FC1");
  message = make();
  message->height = 0;
  EXPECT_REFUSED(imageView(*message, enc::TYPE_32FC1, "disparity"), "disparity: ", "empty (5x0)");
  message = make();
  message->step = 19;
  EXPECT_REFUSED(imageView(*message, enc::TYPE_32FC1, "disparity"),
                 "disparity: ", "step is 19 bytes, expected at least 20");
  message = make();
  message->step = 22;
  message->data.resize(66);
  EXPECT_REFUSED(imageView(*message, enc::TYPE_32FC1, "disparity"), "disparity: ", "a multiple of 4");
  message = make();
  message->data.resize(59);
  EXPECT_REFUSED(imageView(*message, enc::TYPE_32FC1, "disparity"), "disparity: ", "59 bytes, expected 60");
  message = make();
  message->is_bigendian = message->is_bigendian == 0 ? 1 : 0;
  EXPECT_REFUSED(imageView(*message, enc::TYPE_32FC1, "disparity"), "disparity: ", "is_bigendian");
  message = make();
  message->width = std::numeric_limits<std::uint32_t>::max();
  message->step = std::numeric_limits<std::uint32_t>::max();
  EXPECT_REFUSED(imageView(*message, enc::TYPE_32FC1, "disparity"), "disparity: ", "step");
}

/// A map of 3x2 with the range 2...10, and 5 everywhere.
stereo_msgs::DisparityImagePtr disparityImage() {
  StereoGeometry geometry;
  geometry.focal_length = 400.0;
  geometry.baseline = 0.5;
  DisparityRange range;
  range.min = 2.0F;
  range.max = 10.0F;
  std_msgs::Header header;
  header.stamp = ros::Time(12, 34);
  header.frame_id = "stereo_left";
  auto message = makeDisparityImage(header, {3, 2}, geometry, range, {1, 0, 2, 1});
  cv::Mat map = imageView(message->image, enc::TYPE_32FC1, "disparity");
  map = 5.0F;
  return message;
}

TEST(MakeDisparityImage, fillsEveryField) {
  const auto message = disparityImage();
  for (const std_msgs::Header& header : {message->header, message->image.header}) {
    EXPECT_EQ(header.stamp, ros::Time(12, 34));
    EXPECT_EQ(header.frame_id, "stereo_left");
  }
  EXPECT_EQ(message->image.encoding, "32FC1");
  EXPECT_EQ(message->image.width, 3U);
  EXPECT_EQ(message->image.height, 2U);
  EXPECT_EQ(message->image.step, 12U);
  EXPECT_EQ(message->image.data.size(), 24U);
  EXPECT_EQ(message->f, 400.0F);
  EXPECT_EQ(message->T, 0.5F);
  EXPECT_EQ(message->min_disparity, 2.0F);
  EXPECT_EQ(message->max_disparity, 10.0F);
  EXPECT_EQ(message->delta_d, 0.0625F);
  EXPECT_EQ(message->valid_window.x_offset, 1U);
  EXPECT_EQ(message->valid_window.y_offset, 0U);
  EXPECT_EQ(message->valid_window.width, 2U);
  EXPECT_EQ(message->valid_window.height, 1U);
}

TEST(DisparityRangeOfMessage, takesWhatThePublisherSays) {
  const DisparityRange range = disparityRange(*disparityImage(), "disparity");
  EXPECT_EQ(range.min, 2.0F);
  EXPECT_EQ(range.max, 10.0F);
}

TEST(DisparityRangeOfMessage, raisesAMaximumThatIsTooSmall) {
  const auto message = disparityImage();
  cv::Mat map = imageView(message->image, enc::TYPE_32FC1, "disparity");
  // As stereo_image_proc: max_disparity is min + range - 1, the map reaches 15/16 above it.
  map.at<float>(1, 2) = 10.9375F;
  EXPECT_EQ(disparityRange(*message, "disparity").max, 11.0F);
  for (const float max : {0.0F, -1.0F, 2.0F, 10.5F, NOT_A_NUMBER}) {
    message->max_disparity = max;
    EXPECT_EQ(disparityRange(*message, "disparity").max, 11.0F) << max;
  }
  message->max_disparity = INFINITE;
  EXPECT_EQ(disparityRange(*message, "disparity").max, 11.0F);
  message->max_disparity = 10.9375F;
  EXPECT_EQ(disparityRange(*message, "disparity").max, 10.9375F);
}

TEST(DisparityRangeOfMessage, ignoresWhatIsNoDisparity) {
  const auto message = disparityImage();
  cv::Mat map = imageView(message->image, enc::TYPE_32FC1, "disparity");
  map.at<float>(0, 0) = NOT_A_NUMBER;
  map.at<float>(0, 1) = INFINITE;
  map.at<float>(0, 2) = -INFINITE;
  map.at<float>(1, 0) = 1.0F;
  EXPECT_EQ(disparityRange(*message, "disparity").max, 10.0F);
  message->max_disparity = 0.0F;
  EXPECT_EQ(disparityRange(*message, "disparity").max, 6.0F);
}

TEST(DisparityRangeOfMessage, isNotEmptyForAMapWithoutDisparity) {
  const auto message = disparityImage();
  cv::Mat map = imageView(message->image, enc::TYPE_32FC1, "disparity");
  map = NOT_A_NUMBER;
  message->max_disparity = 0.0F;
  EXPECT_EQ(disparityRange(*message, "disparity").max, 3.0F);
}

TEST(DisparityRangeOfMessage, refusesAMinimumThatIsNotFinite) {
  const auto message = disparityImage();
  // From 2^24 on min - 1, the invalid value, may be min itself.
  for (const float min : {NOT_A_NUMBER, INFINITE, -INFINITE, -16777216.0F, 1e30F}) {
    message->min_disparity = min;
    EXPECT_REFUSED(disparityRange(*message, "disparity"), "disparity: ", "min_disparity");
  }
}

TEST(DisparityGeometry, refusesWhatIsNotPositive) {
  const auto message = disparityImage();
  EXPECT_EQ(disparityGeometry(*message, "disparity").focal_length, 400.0);
  EXPECT_EQ(disparityGeometry(*message, "disparity").baseline, 0.5);
  for (const float bad : {0.0F, -1.0F, NOT_A_NUMBER}) {
    message->f = bad;
    EXPECT_REFUSED(disparityGeometry(*message, "disparity"), "disparity: ", "f is ");
    message->f = 400.0F;
    message->T = bad;
    EXPECT_REFUSED(disparityGeometry(*message, "disparity"), "disparity: ", "T is ");
    message->T = 0.5F;
  }
}

TEST(DepthImage, isFTimesTOverD) {
  StereoGeometry geometry;
  geometry.focal_length = 400.0;
  geometry.baseline = 0.5;
  DisparityRange range;
  range.min = -2.0F;
  std_msgs::Header header;
  header.stamp = ros::Time(12, 34);
  header.frame_id = "stereo_left";
  // Invalid, behind infinity, infinitely far, 1 px, 40 px, NaN.
  const cv::Mat disparity = (cv::Mat_<float>(2, 3) << -3.0F, -1.0F, 0.0F, 1.0F, 40.0F, NOT_A_NUMBER);
  const auto message = depthImage(header, disparity, range, geometry);
  EXPECT_EQ(message->header.stamp, header.stamp);
  EXPECT_EQ(message->header.frame_id, header.frame_id);
  const cv::Mat z = imageView(*message, enc::TYPE_32FC1, "depth");
  EXPECT_TRUE(std::isnan(z.at<float>(0, 0)));
  EXPECT_TRUE(std::isnan(z.at<float>(0, 1)));
  EXPECT_TRUE(std::isnan(z.at<float>(0, 2)));
  EXPECT_EQ(z.at<float>(1, 0), 200.0F);
  EXPECT_EQ(z.at<float>(1, 1), 5.0F);
  EXPECT_TRUE(std::isnan(z.at<float>(1, 2)));
}

TEST(PlanesMessage, copiesEveryField) {
  SegmentPlane plane;
  plane.a = 0.25;
  plane.b = -0.5;
  plane.c = 7.0;
  plane.pixels = 100;
  plane.valid = 90;
  plane.inliers = 80;
  plane.iterations = 70;
  plane.status = PlaneStatus::MAX_ITERATIONS;
  std_msgs::Header header;
  header.stamp = ros::Time(12, 34);
  const auto message = planesMessage(header, {SegmentPlane(), plane});
  EXPECT_EQ(message->header.stamp, header.stamp);
  ASSERT_EQ(message->planes.size(), 2U);
  EXPECT_EQ(message->planes[0].status, Plane::TOO_FEW_POINTS);
  const Plane& copy = message->planes[1];
  EXPECT_EQ(copy.a, 0.25);
  EXPECT_EQ(copy.b, -0.5);
  EXPECT_EQ(copy.c, 7.0);
  EXPECT_EQ(copy.pixels, 100U);
  EXPECT_EQ(copy.valid, 90U);
  EXPECT_EQ(copy.inliers, 80U);
  EXPECT_EQ(copy.iterations, 70U);
  EXPECT_EQ(copy.status, Plane::MAX_ITERATIONS);
}

TEST(PlanesMessage, isReadAsItWasWritten) {
  SegmentPlane plane;
  plane.a = 0.25;
  plane.b = -0.5;
  plane.c = 7.0;
  plane.pixels = 100;
  plane.valid = 90;
  plane.inliers = 80;
  plane.iterations = 70;
  plane.status = PlaneStatus::OF_NEIGHBOUR;
  const auto planes = segmentPlanes(*planesMessage({}, {SegmentPlane(), plane}), "planes");
  ASSERT_EQ(planes.size(), 2U);
  EXPECT_EQ(planes[0].status, PlaneStatus::TOO_FEW_POINTS);
  EXPECT_EQ(planes[1].a, 0.25);
  EXPECT_EQ(planes[1].b, -0.5);
  EXPECT_EQ(planes[1].c, 7.0);
  EXPECT_EQ(planes[1].pixels, 100);
  EXPECT_EQ(planes[1].valid, 90);
  EXPECT_EQ(planes[1].inliers, 80);
  EXPECT_EQ(planes[1].iterations, 70);
  EXPECT_EQ(planes[1].status, PlaneStatus::OF_NEIGHBOUR);
}

TEST(PlanesMessage, isRefusedWithAnUnknownStatus) {
  Planes message;
  message.planes.resize(3);
  message.planes[2].status = 5;
  try {
    segmentPlanes(message, "/stereo/planes");
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(),
                 "/stereo/planes: the status of plane 2 is 5, expected one of Plane.msg, 0 to 4");
  }
}

TEST(PlanesMessage, hasTheStatusOfTheCore) {
  EXPECT_EQ(static_cast<int>(PlaneStatus::ACCEPTED), Plane::ACCEPTED);
  EXPECT_EQ(static_cast<int>(PlaneStatus::TOO_FEW_POINTS), Plane::TOO_FEW_POINTS);
  EXPECT_EQ(static_cast<int>(PlaneStatus::DEGENERATE), Plane::DEGENERATE);
  EXPECT_EQ(static_cast<int>(PlaneStatus::MAX_ITERATIONS), Plane::MAX_ITERATIONS);
  EXPECT_EQ(static_cast<int>(PlaneStatus::OF_NEIGHBOUR), Plane::OF_NEIGHBOUR);
}

}  // namespace
}  // namespace disparity_refinement
