// Bad input gives one clear, throttled error; the nodelets live on and process the next good frame.

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <stereo_msgs/DisparityImage.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <set>

#include "ChainClient.hpp"
#include "DisparityContract.hpp"

namespace disparity_refinement {
namespace {

namespace enc = sensor_msgs::image_encodings;
using rosgraph_msgs::Log;
using sensor_msgs::Image;
using stereo_msgs::DisparityImage;

const float NOT_A_NUMBER = std::numeric_limits<float>::quiet_NaN();
const float INFINITE = std::numeric_limits<float>::infinity();

int countValid(const DisparityImage& message) {
  return cv::countNonZero(imageView(message.image, enc::TYPE_32FC1, "disparity") >= message.min_disparity);
}

/// Bad pairs for the whole chain.
class BadPair : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    rig_ = std::make_unique<Rig>();
    ASSERT_TRUE(rig_->camera.waitForChain(rig_->refined));
    ASSERT_TRUE(rig_->camera.waitForChain(rig_->borders));
    // Until an error arrives, the log is not connected to the manager yet.
    for (int i = 0; i < 100 && !rig_->log.waitFor({"'probe"}, Log::ERROR, 0.2); ++i) {
      StereoMessages messages = next();
      messages.left->encoding = "probe" + std::to_string(i);
      rig_->camera.publish(messages);
    }
  }

  static void TearDownTestSuite() { rig_.reset(); }

  /// The next good pair.
  static StereoMessages next() {
    return rig_->camera.make(rig_->frame.left, rig_->frame.right, StereoCamera::stamp(rig_->index++));
  }

  /// The refined map of a pair, null if none comes.
  static DisparityImage::ConstPtr process(const StereoMessages& messages) {
    rig_->camera.publish(messages);
    const ros::Time& stamp = messages.left->header.stamp;
    EXPECT_TRUE(rig_->borders.wait(stamp)) << "the visualization draws no segment borders";
    return rig_->refined.wait(stamp);
  }

  static void expectGoodFrame() {
    const auto message = process(next());
    ASSERT_TRUE(message) << "the good frame after the bad one is not processed";
    expectContract(*message);
    EXPECT_GT(countValid(*message), 320 * 120 / 2);
  }

  /// Sends a spoilt pair and expects an error with all `words`, no result, and the next good frame.
  static void expectError(const std::function<void(StereoMessages&)>& spoil,
                          const std::vector<std::string>& words) {
    StereoMessages messages = next();
    spoil(messages);
    rig_->camera.publish(messages);
    EXPECT_TRUE(rig_->log.waitFor(words, Log::ERROR));
    expectGoodFrame();
    EXPECT_FALSE(rig_->refined.wait(messages.left->header.stamp, 0.0));
  }

  struct Rig {
    ros::NodeHandle nh{"/stereo"};
    LogListener log{nh};
    StereoCamera camera{nh};
    Listener<DisparityImage> refined{nh, "disparity_refined"};
    Listener<Image> borders{nh, "segment_borders"};
    StreetFrame frame = camera.street().render(0);
    int index = 0;
  };
  static std::unique_ptr<Rig> rig_;
};

std::unique_ptr<BadPair::Rig> BadPair::rig_;

TEST_F(BadPair, ofDifferentSize) {
  expectError(
      [](StereoMessages& messages) {
        const StreetFrame& frame = rig_->frame;
        messages = rig_->camera.make(frame.left, frame.right.colRange(0, 300), messages.left->header.stamp);
      },
      {"/stereo/left/image_rect", "/stereo/right/image_rect", "320x120", "300x120"});
}

TEST_F(BadPair, ofUnknownEncoding) {
  expectError([](StereoMessages& messages) { messages.left->encoding = "yuv999"; },
              {"[/stereo/disparity]", "/stereo/left/image_rect", "unknown encoding 'yuv999'"});
  expectError([](StereoMessages& messages) { messages.left->encoding = "yuv998"; },
              {"[/stereo/segmentation]", "/stereo/left/image_rect", "unknown encoding 'yuv998'"});
  expectError([](StereoMessages& messages) { messages.right->encoding = "yuv997"; },
              {"[/stereo/disparity]", "/stereo/right/image_rect", "unknown encoding 'yuv997'"});
  expectError([](StereoMessages& messages) { messages.left->encoding = ""; },
              {"/stereo/left/image_rect", "unknown encoding ''"});
}

TEST_F(BadPair, withoutCalibration) {
  expectError([](StereoMessages& messages) { messages.left_info->P.fill(0.0); },
              {"/stereo/left/camera_info", "P[0]", "calibrated"});
}

TEST_F(BadPair, withoutPositiveBaseline) {
  expectError([](StereoMessages& messages) { std::swap(messages.left_info->P, messages.right_info->P); },
              {"/stereo/right/camera_info", "P_right[3]", "swapped", "-100 - 0"});
  expectError([](StereoMessages& messages) { messages.right_info->P[3] = 0.0; },
              {"/stereo/right/camera_info", "P_right[3]", "0 - 0"});
}

TEST_F(BadPair, narrowerThanTheDisparityRange) {
  expectError(
      [](StereoMessages& messages) {
        const StreetFrame& frame = rig_->frame;
        messages = rig_->camera.make(frame.left.colRange(0, 48), frame.right.colRange(0, 48),
                                     messages.left->header.stamp);
      },
      {"/stereo/left/image_rect", "width", "48", "disparity_range 64"});
}

TEST_F(BadPair, ofEmptyImages) {
  expectError(
      [](StereoMessages& messages) {
        for (const auto& image : {messages.left, messages.right}) {
          image->width = image->height = image->step = 0;
          image->data.clear();
        }
      },
      {"/stereo/left/image_rect", "empty"});
  expectError([](StereoMessages& messages) { messages.right->height = 0; },
              {"/stereo/right/image_rect", "empty"});
}

TEST_F(BadPair, withTooLittleData) {
  expectError([](StereoMessages& messages) { messages.left->data.pop_back(); },
              {"[/stereo/disparity]", "/stereo/left/image_rect", "38399 bytes, expected 38400"});
  expectError([](StereoMessages& messages) { messages.left->data.resize(38398); },
              {"[/stereo/segmentation]", "/stereo/left/image_rect", "38398 bytes, expected 38400"});
  expectError([](StereoMessages& messages) { messages.right->data.clear(); },
              {"/stereo/right/image_rect", "0 bytes, expected 38400"});
  expectError([](StereoMessages& messages) { messages.left->step = 319; },
              {"/stereo/left/image_rect", "step is 319"});
}

TEST_F(BadPair, isReportedOnceForManyFrames) {
  // Counted on /diagnostics, logged once.
  Listener<diagnostic_msgs::DiagnosticArray> diagnostics(rig_->nh, "/diagnostics");
  const auto waitForErrors = [&diagnostics](long at_least) {
    long errors = -1;
    diagnostics.wait([&](const diagnostic_msgs::DiagnosticArray& array) {
      for (const auto& status : array.status) {
        if (status.name.find("stereo/disparity") == std::string::npos) continue;
        for (const auto& value : status.values) {
          if (value.key == "errors") errors = std::stol(value.value);
        }
      }
      return errors >= at_least;
    });
    return errors;
  };
  const long before = waitForErrors(0);
  ASSERT_GE(before, 0);

  constexpr int FRAMES = 4;  // fewer than a queue holds
  const ros::WallTime begin = ros::WallTime::now();
  for (int i = 0; i < FRAMES; ++i) {
    StereoMessages messages = next();
    messages.left->encoding = "again and again";
    rig_->camera.publish(messages);
  }
  expectGoodFrame();
  diagnostics.clear();
  EXPECT_GE(waitForErrors(before + FRAMES), before + FRAMES);

  std::set<const Log*> lines;
  rig_->log.messages().wait(
      [&lines](const Log& log) {
        const bool is_meant = log.msg.find("[/stereo/disparity]") != std::string::npos &&
                              log.msg.find("again and again") != std::string::npos;
        if (is_meant) lines.insert(&log);
        return false;
      },
      0.0);
  // On a machine that stands still for five seconds the text is due again.
  const double seconds = (ros::WallTime::now() - begin).toSec();
  EXPECT_GE(lines.size(), 1U);
  EXPECT_LE(lines.size(), 1U + static_cast<std::size_t>(seconds / 5.0));
  EXPECT_LT(lines.size(), static_cast<std::size_t>(FRAMES));
}

TEST_F(BadPair, withDifferentFramesIsProcessedInTheLeftOne) {
  StereoMessages messages = next();
  messages.right->header.frame_id = messages.right_info->header.frame_id = "another_right";
  const auto message = process(messages);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->header.frame_id, "stereo_left");
  EXPECT_EQ(message->image.header.frame_id, "stereo_left");
  expectContract(*message);
  EXPECT_TRUE(
      rig_->log.waitFor({"/stereo/right/camera_info", "'stereo_left'", "'another_right'"}, Log::WARN));
  EXPECT_FALSE(rig_->log.waitFor({"'another_right'"}, Log::ERROR, 0.0)) << "a warning only";
}

TEST_F(BadPair, withPAloneIsGood) {
  StereoMessages messages = next();
  for (const auto& info : {messages.left_info, messages.right_info}) {
    info->K.fill(0.0);
    info->R.fill(0.0);
    info->D.clear();
    info->distortion_model.clear();
  }
  const auto message = process(messages);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->f, 200.0F);
  EXPECT_EQ(message->T, 0.5F);
  expectContract(*message);
}

/// A gray picture in another encoding; Bayer with the gray values as they are.
cv::Mat encode(const cv::Mat& gray, const std::string& encoding) {
  cv::Mat picture;
  if (encoding == enc::MONO16) {
    gray.convertTo(picture, CV_16UC1, 257.0);
  } else if (enc::isBayer(encoding)) {
    picture = gray;
  } else {
    cv::cvtColor(gray, picture, enc::numChannels(encoding) == 4 ? cv::COLOR_GRAY2BGRA : cv::COLOR_GRAY2BGR);
  }
  return picture;
}

TEST_F(BadPair, inAnotherEncodingIsGood) {
  const auto mono = process(next());
  ASSERT_TRUE(mono);
  const int expected = countValid(*mono);
  for (const std::string& encoding :
       {enc::MONO16, enc::BGR8, enc::RGB8, enc::BGRA8, enc::RGBA8, enc::BAYER_RGGB8, enc::BAYER_BGGR8,
        enc::BAYER_GBRG8, enc::BAYER_GRBG8}) {
    StereoMessages messages = next();
    messages.left = StereoCamera::image(messages.left->header, encode(rig_->frame.left, encoding), encoding);
    messages.right =
        StereoCamera::image(messages.right->header, encode(rig_->frame.right, encoding), encoding);
    const auto message = process(messages);
    ASSERT_TRUE(message) << encoding;
    expectContract(*message);
    if (enc::isBayer(encoding)) {
      // Demosaicing blurs, so the map is a slightly different one.
      EXPECT_GT(countValid(*message), 0.8 * expected) << encoding;
    } else {
      EXPECT_EQ(message->image.data, mono->image.data) << encoding;
    }
  }
}

/// Disparity maps and labels of another publisher, for a refiner alone.
class ForeignDisparity : public testing::Test {
 protected:
  static constexpr int WIDTH = 64, HEIGHT = 48;

  struct Frame {
    stereo_msgs::DisparityImagePtr disparity;
    sensor_msgs::ImagePtr labels;

    cv::Mat map() const { return imageView(disparity->image, enc::TYPE_32FC1, "disparity"); }
    cv::Mat segments() const { return imageView(*labels, enc::TYPE_32SC1, "labels"); }
  };

  static void SetUpTestSuite() {
    rig_ = std::make_unique<Rig>();
    const auto any = [](const DisparityImage&) { return true; };
    for (int i = 0; i < 100 && !rig_->refined.wait(any, 0.2); ++i) publish(next());
    ASSERT_GT(rig_->refined.count(), 0U);
    for (int i = 0; i < 100 && !rig_->log.waitFor({"'probe"}, Log::ERROR, 0.2); ++i) {
      const Frame frame = next();
      frame.labels->encoding = "probe" + std::to_string(i);
      publish(frame);
    }
  }

  static void TearDownTestSuite() { rig_.reset(); }

  static float plane(int x, int y) { return 10.0F + 0.125F * x + 0.0625F * y; }

  /// One plane with a hole, in a left and a right segment.
  static Frame next() {
    std_msgs::Header header;
    header.stamp = StereoCamera::stamp(rig_->index++);
    header.frame_id = "foreign_left";
    StereoGeometry geometry;
    geometry.focal_length = 200.0;
    geometry.baseline = 0.5;
    DisparityRange range;
    range.max = 64.0F;
    const cv::Size size(WIDTH, HEIGHT);
    Frame frame;
    frame.disparity = makeDisparityImage(header, size, geometry, range, {8, 2, 48, 44});
    frame.labels = makeImage(header, size, enc::TYPE_32SC1);
    cv::Mat map = frame.map(), segments = frame.segments();
    for (int y = 0; y < HEIGHT; ++y) {
      for (int x = 0; x < WIDTH; ++x) {
        map.at<float>(y, x) = plane(x, y);
        segments.at<int>(y, x) = x < WIDTH / 2 ? 0 : 1;
      }
    }
    map(hole()) = range.invalid();
    return frame;
  }

  /// Across both segments.
  static cv::Rect hole() { return {24, 20, 16, 10}; }

  static void publish(const Frame& frame) {
    rig_->disparity.publish(frame.disparity);
    rig_->labels.publish(frame.labels);
  }

  static DisparityImage::ConstPtr process(const Frame& frame) {
    publish(frame);
    return rig_->refined.wait(frame.disparity->header.stamp);
  }

  /// The plane without its hole; one pixel is invalid in every frame.
  static void expectPlane(const DisparityImage& message) {
    expectContract(message);
    const cv::Mat map = imageView(message.image, enc::TYPE_32FC1, "disparity_refined");
    for (int y = 0; y < HEIGHT; ++y) {
      for (int x = 0; x < WIDTH; ++x) {
        if (x > 0 || y > 0) {
          ASSERT_NEAR(map.at<float>(y, x), plane(x, y), 1e-3) << x << ", " << y;
        }
      }
    }
  }

  static void expectError(const std::function<void(Frame&)>& spoil, const std::vector<std::string>& words) {
    Frame frame = next();
    spoil(frame);
    publish(frame);
    EXPECT_TRUE(rig_->log.waitFor(words, Log::ERROR));
    const auto message = process(next());
    ASSERT_TRUE(message) << "the good frame after the bad one is not processed";
    expectPlane(*message);
    EXPECT_FALSE(rig_->refined.wait(frame.disparity->header.stamp, 0.0));
  }

  /// Sends an odd frame and expects the whole plane all the same.
  static DisparityImage::ConstPtr expectRepair(const std::function<void(Frame&)>& spoil) {
    Frame frame = next();
    spoil(frame);
    const auto message = process(frame);
    EXPECT_TRUE(message);
    if (message) expectPlane(*message);
    return message;
  }

  struct Rig {
    ros::NodeHandle nh{"/foreign"};
    LogListener log{nh};
    ros::Publisher disparity = nh.advertise<DisparityImage>("disparity", 10);
    ros::Publisher labels = nh.advertise<Image>("labels", 10);
    Listener<DisparityImage> refined{nh, "disparity_refined"};
    int index = 0;
  };
  static std::unique_ptr<Rig> rig_;
};

std::unique_ptr<ForeignDisparity::Rig> ForeignDisparity::rig_;

TEST_F(ForeignDisparity, keepsHeaderGeometryAndWindow) {
  const auto message = expectRepair([](Frame& frame) { frame.disparity->delta_d = 0.25F; });
  ASSERT_TRUE(message);
  EXPECT_EQ(message->header.frame_id, "foreign_left");
  EXPECT_EQ(message->image.header.frame_id, "foreign_left");
  EXPECT_EQ(message->f, 200.0F);
  EXPECT_EQ(message->T, 0.5F);
  EXPECT_EQ(message->min_disparity, 0.0F);
  EXPECT_EQ(message->max_disparity, 64.0F);
  EXPECT_EQ(message->delta_d, 0.25F);
  EXPECT_EQ(message->valid_window.x_offset, 8U);
  EXPECT_EQ(message->valid_window.y_offset, 2U);
  EXPECT_EQ(message->valid_window.width, 48U);
  EXPECT_EQ(message->valid_window.height, 44U);
}

TEST_F(ForeignDisparity, takesAnythingBelowMinAndNotFiniteForInvalid) {
  for (const float bad : {NOT_A_NUMBER, INFINITE, -INFINITE, -10.0F, -0.5F}) {
    SCOPED_TRACE(bad);
    expectRepair([bad](Frame& frame) {
      cv::Mat map = frame.map();
      map(hole()) = cv::Scalar(bad);
      map.at<float>(0, 0) = bad;
      map.at<float>(HEIGHT - 1, WIDTH - 1) = bad;
    });
  }
  // Zero is invalid for some publishers: they say so by their min_disparity.
  const auto message = expectRepair([](Frame& frame) {
    frame.disparity->min_disparity = 1.0F;
    frame.map()(hole()) = cv::Scalar(0.0);
  });
  ASSERT_TRUE(message);
  EXPECT_EQ(message->min_disparity, 1.0F);
}

TEST_F(ForeignDisparity, withoutAnyDisparityStaysEmpty) {
  for (const float bad : {NOT_A_NUMBER, -1.0F}) {
    Frame frame = next();
    frame.map() = cv::Scalar(bad);
    const auto message = process(frame);
    ASSERT_TRUE(message) << bad;
    expectContract(*message);
    EXPECT_EQ(countValid(*message), 0) << bad;
  }
}

TEST_F(ForeignDisparity, hasItsStepBetweenDisparitiesRepaired) {
  for (const float delta : {0.0F, -1.0F, NOT_A_NUMBER}) {
    const auto message = expectRepair([delta](Frame& frame) { frame.disparity->delta_d = delta; });
    ASSERT_TRUE(message);
    EXPECT_EQ(message->delta_d, 0.0625F) << delta;
  }
}

TEST_F(ForeignDisparity, hasItsMaximumRaised) {
  // The largest disparity is 20.8125.
  for (const float max : {0.0F, -1.0F, 20.0F, NOT_A_NUMBER, INFINITE}) {
    const auto message = expectRepair([max](Frame& frame) { frame.disparity->max_disparity = max; });
    ASSERT_TRUE(message);
    EXPECT_EQ(message->max_disparity, 21.0F) << max;
  }
}

TEST_F(ForeignDisparity, hasItsWindowRepaired) {
  const std::uint32_t wrapped = 4294967281U;
  const std::function<void(sensor_msgs::RegionOfInterest&)> bad_windows[] = {
      [=](sensor_msgs::RegionOfInterest& window) { window.width = wrapped; },
      [=](sensor_msgs::RegionOfInterest& window) { window.x_offset = wrapped; },
      [=](sensor_msgs::RegionOfInterest& window) { window.x_offset = window.width = wrapped; },
      [=](sensor_msgs::RegionOfInterest& window) { window.height = wrapped; },
      [](sensor_msgs::RegionOfInterest& window) { window.y_offset = HEIGHT; },
      [](sensor_msgs::RegionOfInterest& window) { window = sensor_msgs::RegionOfInterest(); }};
  for (const auto& spoil : bad_windows) {
    const auto message = expectRepair([&spoil](Frame& frame) { spoil(frame.disparity->valid_window); });
    ASSERT_TRUE(message);
    EXPECT_EQ(message->valid_window.x_offset, 0U);
    EXPECT_EQ(message->valid_window.y_offset, 0U);
    EXPECT_EQ(message->valid_window.width, std::uint32_t{WIDTH});
    EXPECT_EQ(message->valid_window.height, std::uint32_t{HEIGHT});
  }
}

TEST_F(ForeignDisparity, mayHavePaddedRows) {
  expectRepair([](Frame& frame) {
    const Image dense = frame.disparity->image;
    Image& padded = frame.disparity->image;
    padded.step += 8;
    padded.data.assign(padded.step * padded.height, 0xFF);
    for (std::uint32_t y = 0; y < dense.height; ++y) {
      std::copy_n(dense.data.begin() + y * dense.step, dense.step, padded.data.begin() + y * padded.step);
    }
  });
}

TEST_F(ForeignDisparity, ofAnotherLayoutIsAnError) {
  const std::string topic = "/foreign/disparity: ";
  expectError([](Frame& frame) { frame.disparity->image.encoding = enc::TYPE_16UC1; },
              {topic, "encoding is '16UC1', expected 32FC1"});
  expectError([](Frame& frame) { frame.disparity->image.step = 4 * WIDTH - 4; }, {topic, "step is 252"});
  expectError(
      [](Frame& frame) {
        frame.disparity->image.step += 2;
        frame.disparity->image.data.resize(frame.disparity->image.step * HEIGHT);
      },
      {topic, "step is 258", "a multiple of 4"});
  expectError([](Frame& frame) { frame.disparity->image.step += 4; }, {topic, "12288 bytes, expected 12480"});
  expectError([](Frame& frame) { frame.disparity->image.data.clear(); }, {topic, "0 bytes, expected 12288"});
  expectError([](Frame& frame) { frame.disparity->image.width = 0; }, {topic, "empty"});
  expectError([](Frame& frame) { frame.disparity->image.is_bigendian ^= 1; }, {topic, "is_bigendian"});
}

TEST_F(ForeignDisparity, withoutATimeIsAnError) {
  expectError([](Frame& frame) { frame.disparity->header.stamp = frame.labels->header.stamp = ros::Time(); },
              {"/foreign/disparity: the stamp is 0", "expected the time of exposure"});
}

TEST_F(ForeignDisparity, withoutLabelsOfItsStampIsReported) {
  const auto expectWarning = [](const std::function<void(const Frame&)>& send,
                                const std::vector<std::string>& words) {
    EXPECT_TRUE(waitFor([&] {
      send(next());
      return rig_->log.waitFor(words, Log::WARN, 0.1);
    })) << words[0];
    const auto message = process(next());
    ASSERT_TRUE(message) << "the good frame after the bad one is not processed";
    expectPlane(*message);
  };
  expectWarning(
      [](const Frame& frame) {
        frame.labels->header.stamp += ros::Duration(0.001);
        publish(frame);
      },
      {"no two messages with the same stamp for 0.5 s", "/foreign/disparity ", "/foreign/labels ",
       "both need the stamp of the left image"});
  expectWarning([](const Frame& frame) { rig_->disparity.publish(frame.disparity); },
                {"no two messages with the same stamp", "/foreign/labels 0", "does its publisher run?"});
  expectWarning([](const Frame& frame) { rig_->labels.publish(frame.labels); },
                {"no two messages with the same stamp", "/foreign/disparity 0", "does its publisher run?"});
}

TEST_F(ForeignDisparity, withoutGeometryIsAnError) {
  const std::string topic = "/foreign/disparity: ";
  expectError([](Frame& frame) { frame.disparity->f = 0.0F; }, {topic, "f is 0 px"});
  expectError([](Frame& frame) { frame.disparity->f = -200.0F; }, {topic, "f is -200 px"});
  expectError([](Frame& frame) { frame.disparity->f = NOT_A_NUMBER; }, {topic, "f is nan px"});
  expectError([](Frame& frame) { frame.disparity->f = INFINITE; }, {"/foreign/disparity", "is inf"});
  expectError([](Frame& frame) { frame.disparity->T = 0.0F; }, {topic, "T is 0 m"});
  expectError([](Frame& frame) { frame.disparity->T = -0.5F; }, {topic, "T is -0.5 m"});
  expectError([](Frame& frame) { frame.disparity->min_disparity = NOT_A_NUMBER; },
              {topic, "min_disparity is nan"});
}

TEST_F(ForeignDisparity, withBadLabelsIsAnError) {
  const std::string topic = "/foreign/labels";
  expectError([](Frame& frame) { frame.labels->encoding = enc::MONO8; },
              {topic, "encoding is 'mono8', expected 32SC1"});
  expectError(
      [](Frame& frame) {
        frame.labels = makeImage(frame.disparity->header, {WIDTH, HEIGHT - 1}, enc::TYPE_32SC1);
      },
      {topic, "64x47", "64x48"});
  expectError([](Frame& frame) { frame.labels->data.pop_back(); }, {topic, "12287 bytes, expected 12288"});
  expectError([](Frame& frame) { frame.segments().at<int>(5, 7) = WIDTH * HEIGHT; }, {topic, "3072"});
  expectError([](Frame& frame) { frame.segments().at<int>(5, 7) = std::numeric_limits<int>::max(); },
              {topic, "2147483647"});
}

TEST_F(ForeignDisparity, withGapsInTheLabelsIsGood) {
  expectRepair([](Frame& frame) {
    cv::Mat segments = frame.segments();
    segments.setTo(WIDTH * HEIGHT - 1, segments == 1);
  });
}

TEST_F(ForeignDisparity, keepsWhatIsInNoSegment) {
  Frame frame = next();
  cv::Mat segments = frame.segments();
  segments.setTo(-1, segments == 1);
  const auto message = process(frame);
  ASSERT_TRUE(message);
  expectContract(*message);
  const cv::Mat map = imageView(message->image, enc::TYPE_32FC1, "disparity_refined");
  for (int y = 0; y < HEIGHT; ++y) {
    for (int x = 0; x < WIDTH; ++x) {
      const bool is_hole = hole().contains({x, y}) && x >= WIDTH / 2;
      ASSERT_NEAR(map.at<float>(y, x), is_hole ? -1.0F : plane(x, y), 1e-3) << x << ", " << y;
    }
  }
}

}  // namespace
}  // namespace disparity_refinement
