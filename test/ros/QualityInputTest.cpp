// The left image of the refinement beyond the paper: it may come early, late, spoilt or not at all, and no
// frame may be lost for it.

#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <stereo_msgs/DisparityImage.h>

#include "ChainClient.hpp"
#include "CoreChain.hpp"
#include "DisparityContract.hpp"

namespace disparity_refinement {
namespace {

namespace enc = sensor_msgs::image_encodings;
using rosgraph_msgs::Log;
using sensor_msgs::Image;
using stereo_msgs::DisparityImage;

constexpr int WIDTH = 64, HEIGHT = 48;
const DisparityRange RANGE{0.0F, 64.0F};

class QualityInput : public testing::Test {
 protected:
  struct Frame {
    stereo_msgs::DisparityImagePtr disparity;
    sensor_msgs::ImagePtr labels, image;
  };

  static void SetUpTestSuite() {
    rig_ = std::make_unique<Rig>();
    const auto any = [](const DisparityImage&) { return true; };
    for (int i = 0; i < 100 && !rig_->refined.wait(any, 0.2); ++i) publish(next());
    ASSERT_GT(rig_->refined.count(), 0U);
    ASSERT_TRUE(waitFor([] { return rig_->image.getNumSubscribers() > 0; }));
    for (int i = 0; i < 100 && !rig_->log.waitFor({"'probe"}, Log::ERROR, 0.2); ++i) {
      const Frame frame = next();
      frame.image->encoding = "probe" + std::to_string(i);
      publish(frame);
    }
  }

  static void TearDownTestSuite() { rig_.reset(); }

  /// Two planes, the right one without any disparity below: only the refinement beyond the paper fills that.
  static Frame next() {
    std_msgs::Header header;
    header.stamp = StereoCamera::stamp(rig_->index++);
    header.frame_id = "foreign_left";
    StereoGeometry geometry;
    geometry.focal_length = 200.0;
    geometry.baseline = 0.5;
    const cv::Size size(WIDTH, HEIGHT);
    Frame frame;
    frame.disparity = makeDisparityImage(header, size, geometry, RANGE, {0, 0, WIDTH, HEIGHT});
    frame.labels = makeImage(header, size, enc::TYPE_32SC1);
    frame.image = makeImage(header, size, enc::MONO8);
    cv::Mat map = mapOf(*frame.disparity), labels = labelsOf(frame), image = imageOf(frame);
    for (int y = 0; y < HEIGHT; ++y) {
      for (int x = 0; x < WIDTH; ++x) {
        const bool is_right = x >= WIDTH / 2, is_low = y >= HEIGHT / 2;
        labels.at<int>(y, x) = is_right ? (is_low ? 2 : 1) : 0;
        map.at<float>(y, x) = is_right ? (is_low ? RANGE.invalid() : 30.0F) : 10.0F + 0.125F * y;
        image.at<uchar>(y, x) = is_right ? 150 : 50;
      }
    }
    return frame;
  }

  static cv::Mat mapOf(const DisparityImage& message) {
    return imageView(message.image, enc::TYPE_32FC1, "map");
  }
  static cv::Mat labelsOf(const Frame& frame) { return imageView(*frame.labels, enc::TYPE_32SC1, "labels"); }
  static cv::Mat imageOf(const Frame& frame) { return imageView(*frame.image, enc::MONO8, "image"); }

  static void publish(const Frame& frame) {
    rig_->image.publish(frame.image);
    publishWithoutImage(frame);
  }

  static void publishWithoutImage(const Frame& frame) {
    rig_->disparity.publish(frame.disparity);
    rig_->labels.publish(frame.labels);
  }

  static cv::Mat expected(const Frame& frame, RefinementMode mode) {
    RefinementParameters parameters;
    parameters.mode = mode;
    cv::Mat refined;
    const cv::Mat gray = mode == RefinementMode::QUALITY ? imageOf(frame) : cv::Mat();
    DisparityRefinement().refine(mapOf(*frame.disparity), labelsOf(frame), gray, RANGE, 100.0, parameters,
                                 refined);
    return refined;
  }

  static void expectResult(const Frame& frame, RefinementMode mode) {
    const auto message = rig_->refined.wait(frame.disparity->header.stamp);
    ASSERT_TRUE(message);
    expectContract(*message);
    EXPECT_TRUE(sameBits(mapOf(*message), expected(frame, mode)));
  }

  static void expectGoodFrame() {
    const Frame frame = next();
    publish(frame);
    expectResult(frame, RefinementMode::QUALITY);
  }

  /// The frame itself is a good one.
  static void expectError(const Frame& frame, const std::vector<std::string>& words) {
    publish(frame);
    expectResult(frame, RefinementMode::PAPER);
    EXPECT_TRUE(rig_->log.waitFor(words, Log::ERROR));
    expectGoodFrame();
  }

  static void setMode(RefinementMode mode) {
    dynamic_reconfigure::Reconfigure call;
    dynamic_reconfigure::IntParameter parameter;
    parameter.name = "refinement_mode";
    parameter.value = static_cast<int>(mode);
    call.request.config.ints.push_back(parameter);
    ASSERT_TRUE(ros::service::call("/foreign/plane_refinement/set_parameters", call));
  }

  struct Rig {
    ros::NodeHandle nh{"/foreign"};
    LogListener log{nh};
    ros::Publisher disparity = nh.advertise<DisparityImage>("disparity", 10);
    ros::Publisher labels = nh.advertise<Image>("labels", 10);
    ros::Publisher image = nh.advertise<Image>("left/image_rect", 10);
    Listener<DisparityImage> refined{nh, "disparity_refined"};
    int index = 0;
  };
  static std::unique_ptr<Rig> rig_;
};

std::unique_ptr<QualityInput::Rig> QualityInput::rig_;

TEST_F(QualityInput, mayComeBeforeOrAfterTheOthers) {
  const Frame early = next();
  EXPECT_FALSE(sameBits(expected(early, RefinementMode::QUALITY), expected(early, RefinementMode::PAPER)))
      << "the test says little";
  publish(early);
  expectResult(early, RefinementMode::QUALITY);
  const Frame late = next();
  publishWithoutImage(late);
  rig_->image.publish(late.image);
  expectResult(late, RefinementMode::QUALITY);
}

TEST_F(QualityInput, thatIsMissingLosesNoFrame) {
  std::vector<Frame> frames;
  for (int i = 0; i < 12; ++i) {
    frames.push_back(next());
    publishWithoutImage(frames.back());
    // Each ends the wait of the one before; that of the last ends by itself.
    if (i > 0) expectResult(frames[i - 1], RefinementMode::PAPER);
  }
  expectResult(frames.back(), RefinementMode::PAPER);
  EXPECT_TRUE(
      rig_->log.waitFor({"no image on /foreign/left/image_rect", "refined as in the paper"}, Log::WARN));
  expectGoodFrame();
}

TEST_F(QualityInput, ofAnotherLayoutIsAnError) {
  Frame frame = next();
  frame.image = makeImage(frame.disparity->header, {WIDTH, HEIGHT - 1}, enc::MONO8);
  expectError(frame, {"/foreign/left/image_rect", "64x47", "64x48", "refined as in the paper"});
  frame = next();
  frame.image->encoding = "unheard_of";
  expectError(frame, {"/foreign/left/image_rect", "unheard_of"});
  frame = next();
  frame.image->data.pop_back();
  expectError(frame, {"/foreign/left/image_rect", "3071"});
}

TEST_F(QualityInput, isSubscribedToInItsModeOnly) {
  ASSERT_NO_FATAL_FAILURE(setMode(RefinementMode::PAPER));
  EXPECT_TRUE(waitFor([] { return rig_->image.getNumSubscribers() == 0; }));
  for (int i = 0; i < 3; ++i) {
    const Frame frame = next();
    publishWithoutImage(frame);
    expectResult(frame, RefinementMode::PAPER);
  }
  ASSERT_NO_FATAL_FAILURE(setMode(RefinementMode::QUALITY));
  EXPECT_TRUE(waitFor([] { return rig_->image.getNumSubscribers() == 1; }));
  expectGoodFrame();
}

}  // namespace
}  // namespace disparity_refinement
