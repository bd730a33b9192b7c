// The nodelets as stereo_refinement.launch starts them, seen from another process.

#include <diagnostic_msgs/DiagnosticArray.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <stereo_msgs/DisparityImage.h>
#include <visualization_msgs/MarkerArray.h>

#include <cmath>

#include "ChainClient.hpp"
#include "CoreChain.hpp"
#include "DisparityContract.hpp"
#include "disparity_refinement/Planes.h"
#include "disparity_refinement/refinement/Confidence.hpp"

namespace disparity_refinement {
namespace {

using sensor_msgs::CameraInfo;
using sensor_msgs::Image;
using stereo_msgs::DisparityImage;
using visualization_msgs::MarkerArray;

/// The parameters of chain.test, or of quality_chain.test.
CoreParameters testParameters() {
  CoreParameters parameters;
  parameters.matching.disparity_range = 64;
  parameters.segmentation.lambda = 20;
  parameters.segmentation.h = 3;
  parameters.refinement.planes.min_valid_fraction = 0.3;
  if (ros::param::param("~quality", false)) {
    parameters.matching.stereo_algorithm = StereoAlgorithm::CENSUS_SGM;
    parameters.matching.full_width = true;
    parameters.matching.aggregate_rows = true;
    parameters.refinement.mode = RefinementMode::QUALITY;
  }
  return parameters;
}

class Chain : public testing::Test {
 protected:
  void setParameters(int lambda, int h) {
    dynamic_reconfigure::Reconfigure call;
    dynamic_reconfigure::IntParameter parameter;
    parameter.name = "lambda";
    parameter.value = lambda;
    call.request.config.ints.push_back(parameter);
    parameter.name = "h";
    parameter.value = h;
    call.request.config.ints.push_back(parameter);
    ASSERT_TRUE(ros::service::waitForService("segmentation/set_parameters", ros::Duration(TIMEOUT)));
    ASSERT_TRUE(ros::service::call("segmentation/set_parameters", call));
  }

  ros::NodeHandle nh_;
  StereoCamera camera_{nh_};
};

TEST_F(Chain, givesTheBitsOfTheCore) {
  Listener<DisparityImage> raw(nh_, "disparity"), refined(nh_, "disparity_refined");
  Listener<Image> labels(nh_, "labels");
  ASSERT_TRUE(camera_.waitForChain(refined));
  for (int i = 0; i < 5; ++i) {
    const StereoMessages messages = camera_.make(i);
    camera_.publish(messages);
    const auto raw_message = raw.wait(camera_.stamp(i));
    const auto labels_message = labels.wait(camera_.stamp(i));
    const auto refined_message = refined.wait(camera_.stamp(i));
    ASSERT_TRUE(raw_message && labels_message && refined_message) << "frame " << i;
    const CoreResult core = runCore(messages, testParameters());
    EXPECT_TRUE(sameBits(imageView(raw_message->image, "32FC1", "disparity"), core.disparity))
        << "frame " << i;
    EXPECT_TRUE(sameBits(imageView(*labels_message, "32SC1", "labels"), core.labels)) << "frame " << i;
    EXPECT_TRUE(sameBits(imageView(refined_message->image, "32FC1", "refined"), core.refined))
        << "frame " << i;
    EXPECT_GT(cv::countNonZero(core.refined >= core.range.min),
              cv::countNonZero(core.disparity >= core.range.min))
        << "the refinement fills nothing: the test says little";
  }
}

/// Every field that a consumer relies on.
void expectFields(const DisparityImage& message, const StereoMessages& messages, double f, double baseline) {
  EXPECT_EQ(message.header.stamp, messages.left->header.stamp);
  EXPECT_EQ(message.header.frame_id, "stereo_left");
  EXPECT_EQ(message.image.header.stamp, message.header.stamp);
  EXPECT_EQ(message.image.header.frame_id, message.header.frame_id);
  EXPECT_EQ(message.image.encoding, "32FC1");
  EXPECT_EQ(message.image.width, messages.left->width);
  EXPECT_EQ(message.image.height, messages.left->height);
  EXPECT_EQ(message.image.step, 4 * messages.left->width);
  EXPECT_EQ(message.image.data.size(), std::size_t{message.image.step} * message.image.height);
  EXPECT_FLOAT_EQ(message.f, static_cast<float>(f));
  EXPECT_FLOAT_EQ(message.T, static_cast<float>(baseline));
  EXPECT_EQ(message.min_disparity, 0.0F);
  EXPECT_EQ(message.max_disparity, 64.0F);
  EXPECT_EQ(message.delta_d, 1.0F / 16.0F);
  expectContract(message);
}

TEST_F(Chain, fillsEveryFieldOfBothDisparityImages) {
  Listener<DisparityImage> raw(nh_, "disparity"), refined(nh_, "disparity_refined");
  ASSERT_TRUE(camera_.waitForChain(refined));
  const StereoMessages messages = camera_.make(0);
  camera_.publish(messages);
  const auto raw_message = raw.wait(camera_.stamp(0));
  const auto refined_message = refined.wait(camera_.stamp(0));
  ASSERT_TRUE(raw_message && refined_message);
  const StreetParameters& street = camera_.street().parameters();
  expectFields(*raw_message, messages, street.focal_length, street.baseline);
  expectFields(*refined_message, messages, street.focal_length, street.baseline);
}

TEST_F(Chain, readsTheBaselineFromBothProjectionMatrices) {
  Listener<DisparityImage> raw(nh_, "disparity");
  ASSERT_TRUE(camera_.waitForChain(raw));
  // As in KITTI's colour pair: both matrices are relative to a third camera, K is not filled in.
  StereoMessages messages = camera_.make(0);
  const double f = messages.left_info->P[0];
  messages.left_info->P[3] = 0.06 * f;
  messages.right_info->P[3] = -0.47 * f;
  messages.left_info->K.fill(0.0);
  messages.right_info->K.fill(0.0);
  camera_.publish(messages);
  const auto message = raw.wait(camera_.stamp(0));
  ASSERT_TRUE(message);
  EXPECT_FLOAT_EQ(message->T, 0.53F);
}

TEST_F(Chain, subtractsThePrincipalPointOffsetOfAVergedRigOnce) {
  Listener<DisparityImage> raw(nh_, "disparity"), refined(nh_, "disparity_refined");
  ASSERT_TRUE(camera_.waitForChain(refined));
  camera_.publish(0);
  const auto parallel = raw.wait(camera_.stamp(0));
  ASSERT_TRUE(parallel);
  StereoMessages messages = camera_.make(0);
  messages.left->header.stamp = messages.right->header.stamp = messages.left_info->header.stamp =
      messages.right_info->header.stamp = camera_.stamp(1);
  messages.right_info->P[2] -= 5.25;
  camera_.publish(messages);
  const auto verged = raw.wait(camera_.stamp(1));
  const auto verged_refined = refined.wait(camera_.stamp(1));
  ASSERT_TRUE(verged && verged_refined);
  EXPECT_EQ(verged->min_disparity, -5.25F);
  EXPECT_EQ(verged->max_disparity, 58.75F);
  EXPECT_EQ(verged_refined->min_disparity, -5.25F);
  const cv::Mat before = imageView(parallel->image, "32FC1", "parallel");
  const cv::Mat after = imageView(verged->image, "32FC1", "verged");
  EXPECT_EQ(cv::norm(before - 5.25F, after, cv::NORM_INF), 0.0) << "the invalid value is shifted too";
}

TEST_F(Chain, lambdaAndHAreLiveFromTheNextFrameOn) {
  Listener<Image> labels(nh_, "labels");
  Listener<diagnostic_msgs::DiagnosticArray> diagnostics(nh_, "/diagnostics");
  ASSERT_TRUE(camera_.waitForChain(labels));
  int index = 0;
  for (const auto& [lambda, h] : {std::pair<int, int>(80, 15), {5, 2}, {20, 3}}) {
    setParameters(lambda, h);
    const StereoMessages messages = camera_.make(index);
    camera_.publish(messages);
    const auto message = labels.wait(camera_.stamp(index++));
    ASSERT_TRUE(message);
    CoreParameters parameters = testParameters();
    parameters.segmentation.lambda = lambda;
    parameters.segmentation.h = h;
    const CoreResult core = runCore(messages, parameters);
    EXPECT_TRUE(sameBits(imageView(*message, "32SC1", "labels"), core.labels)) << lambda << ", " << h;

    const std::string count = std::to_string(core.segments);
    EXPECT_TRUE(diagnostics.wait([&count](const diagnostic_msgs::DiagnosticArray& array) {
      for (const auto& status : array.status) {
        if (status.name.find("segmentation") == std::string::npos) continue;
        for (const auto& value : status.values) {
          if (value.key == "segments" && value.value == count) return true;
        }
      }
      return false;
    })) << "no diagnostics with "
        << count << " segments";
  }
}

TEST_F(Chain, publishesThePlanesOfTheCore) {
  Listener<Planes> planes(nh_, "planes");
  ASSERT_TRUE(camera_.waitForChain(planes));
  const StereoMessages messages = camera_.make(0);
  camera_.publish(messages);
  const auto message = planes.wait(camera_.stamp(0));
  ASSERT_TRUE(message);
  const CoreResult core = runCore(messages, testParameters());
  EXPECT_EQ(message->header.frame_id, "stereo_left");
  ASSERT_EQ(message->planes.size(), static_cast<std::size_t>(core.segments));
  int accepted = 0;
  for (std::size_t i = 0; i < core.planes.size(); ++i) {
    EXPECT_EQ(message->planes[i].a, core.planes[i].a);
    EXPECT_EQ(message->planes[i].b, core.planes[i].b);
    EXPECT_EQ(message->planes[i].c, core.planes[i].c);
    EXPECT_EQ(message->planes[i].pixels, static_cast<std::uint32_t>(core.planes[i].pixels));
    EXPECT_EQ(message->planes[i].valid, static_cast<std::uint32_t>(core.planes[i].valid));
    EXPECT_EQ(message->planes[i].inliers, static_cast<std::uint32_t>(core.planes[i].inliers));
    EXPECT_EQ(message->planes[i].status, static_cast<std::uint8_t>(core.planes[i].status));
    accepted += message->planes[i].status == Plane::ACCEPTED ? 1 : 0;
  }
  EXPECT_GT(accepted, 0);
}

template <class Parameters>
double valueOf(const Parameters& parameters, const std::string& name) {
  for (const auto& parameter : parameters) {
    if (parameter.name == name) return parameter.value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

TEST_F(Chain, planesTakeTheParametersOfTheirFrameAlong) {
  Listener<Planes> planes(nh_, "planes");
  ASSERT_TRUE(camera_.waitForChain(planes));
  const CoreParameters expected = testParameters();
  int index = 0;
  for (const int lambda : {40, 20}) {
    setParameters(lambda, 3);
    // The first frames may come before planes has subscribed to the parameters too.
    Planes::ConstPtr message;
    EXPECT_TRUE(waitFor([&] {
      message = planes.wait(camera_.publish(index++));
      return message && !message->disparity_parameters.ints.empty() &&
             !message->segmentation_parameters.ints.empty();
    }));
    ASSERT_TRUE(message);
    EXPECT_EQ(valueOf(message->segmentation_parameters.ints, "lambda"), lambda);
    EXPECT_EQ(valueOf(message->segmentation_parameters.ints, "h"), 3);
    EXPECT_EQ(valueOf(message->disparity_parameters.ints, "disparity_range"), 64);
    EXPECT_EQ(valueOf(message->disparity_parameters.bools, "full_width"), expected.matching.full_width);
    EXPECT_EQ(valueOf(message->disparity_parameters.bools, "aggregate_rows"),
              expected.matching.aggregate_rows);
    EXPECT_EQ(valueOf(message->refinement_parameters.ints, "refinement_mode"),
              static_cast<int>(expected.refinement.mode));
    EXPECT_EQ(valueOf(message->refinement_parameters.doubles, "min_valid_fraction"), 0.3);
  }
}

TEST_F(Chain, publishesSourceAndConfidenceOfTheCore) {
  Listener<Image> source(nh_, "disparity_source"), confidence(nh_, "confidence");
  ASSERT_TRUE(camera_.waitForChain(source) && camera_.waitForChain(confidence));
  const StereoMessages messages = camera_.make(0);
  camera_.publish(messages);
  const auto source_message = source.wait(camera_.stamp(0));
  const auto confidence_message = confidence.wait(camera_.stamp(0));
  ASSERT_TRUE(source_message && confidence_message);
  EXPECT_EQ(source_message->header.frame_id, "stereo_left");
  EXPECT_EQ(confidence_message->header.frame_id, "stereo_left");
  const CoreResult core = runCore(messages, testParameters());
  cv::Mat sources, expected;
  findSources(core.disparity, core.refined, core.labels, core.range, core.fitted_planes, sources);
  findConfidence(sources, expected);
  EXPECT_TRUE(sameBits(imageView(*source_message, "mono8", "disparity_source"), sources));
  EXPECT_TRUE(sameBits(imageView(*confidence_message, "mono8", "confidence"), expected));
  double low = 0.0, high = 0.0;
  cv::minMaxLoc(expected, &low, &high);
  EXPECT_LT(low, 50.0);
  EXPECT_GT(high, 200.0);
}

TEST_F(Chain, publishesDepthInMetresWithItsCameraInfo) {
  Listener<Image> depth(nh_, "depth/image_rect");
  Listener<CameraInfo> info(nh_, "depth/camera_info");
  ASSERT_TRUE(camera_.waitForChain(depth) && camera_.waitForChain(info));
  const StereoMessages messages = camera_.make(0);
  camera_.publish(messages);
  const auto message = depth.wait(camera_.stamp(0));
  const auto info_message = info.wait(camera_.stamp(0));
  ASSERT_TRUE(message && info_message);
  EXPECT_EQ(message->header.frame_id, "stereo_left");
  EXPECT_EQ(info_message->header.frame_id, "stereo_left");
  EXPECT_EQ(info_message->P, messages.left_info->P);
  EXPECT_EQ(info_message->width, message->width);
  const CoreResult core = runCore(messages, testParameters());
  const cv::Mat z = imageView(*message, "32FC1", "depth");
  const StreetParameters& street = camera_.street().parameters();
  for (int y = 0; y < z.rows; ++y) {
    for (int x = 0; x < z.cols; ++x) {
      const float d = core.refined.at<float>(y, x);
      if (d > 0.0F) {
        const double expected = street.focal_length * street.baseline / d;
        ASSERT_NEAR(z.at<float>(y, x), expected, 1e-5 * expected);
      } else {
        ASSERT_TRUE(std::isnan(z.at<float>(y, x)));
      }
    }
  }
}

TEST_F(Chain, subscribesOnlyWhileSomebodyListens) {
  EXPECT_TRUE(waitFor([this] { return camera_.leftSubscribers() == 0 && camera_.rightSubscribers() == 0; }));
  {
    Listener<DisparityImage> refined(nh_, "disparity_refined");
    ASSERT_TRUE(camera_.waitForChain(refined));
    EXPECT_GT(camera_.leftSubscribers(), 0);
  }
  EXPECT_TRUE(waitFor([this] { return camera_.leftSubscribers() == 0 && camera_.rightSubscribers() == 0; }));
  {
    Listener<Image> labels(nh_, "labels");
    ASSERT_TRUE(waitFor([this] { return camera_.leftSubscribers() > 0; }));
    EXPECT_EQ(camera_.rightSubscribers(), 0) << "labels need no right image";
  }
  EXPECT_TRUE(waitFor([this] { return camera_.leftSubscribers() == 0; }));
}

TEST_F(Chain, drawsThePicturesThatAreLookedAt) {
  for (const char* topic : {"disparity_color", "disparity_refined_color", "labels_color", "segment_borders",
                            "refused_segments"}) {
    Listener<Image> picture(nh_, topic);
    ASSERT_TRUE(camera_.waitForChain(picture)) << topic;
    const auto message = picture.wait([](const Image&) { return true; });
    ASSERT_TRUE(message) << topic;
    EXPECT_EQ(message->encoding, "bgr8") << topic;
    EXPECT_EQ(message->width, 320U) << topic;
    EXPECT_EQ(message->height, 120U) << topic;
    EXPECT_EQ(message->header.frame_id, "stereo_left") << topic;
    const cv::Mat bgr = imageView(*message, "bgr8", topic);
    cv::Mat channels[3];
    cv::split(bgr, channels);
    EXPECT_GT(cv::norm(channels[0], channels[2], cv::NORM_INF), 50.0) << topic << " has no colour";
  }
}

TEST_F(Chain, drawsThePlanes) {
  {
    Listener<MarkerArray> markers(nh_, "plane_markers");
    ASSERT_TRUE(waitFor([&] {
      static int index = 0;
      camera_.publish(index++);
      return markers.wait(
                 [](const MarkerArray& array) {
                   return array.markers.size() == 2 && !array.markers[0].points.empty() &&
                          array.markers[0].header.frame_id == "stereo_left";
                 },
                 0.5) != nullptr;
    }));
    EXPECT_GT(camera_.infoSubscribers(), 0);
  }
  EXPECT_TRUE(waitFor([this] { return camera_.leftSubscribers() == 0 && camera_.infoSubscribers() == 0; }));
}

}  // namespace
}  // namespace disparity_refinement
