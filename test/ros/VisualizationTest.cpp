// The visualization alone: what it draws of its inputs, what it subscribes to for that, and what it refuses.

#include <gtest/gtest.h>
#include <stereo_msgs/DisparityImage.h>
#include <visualization_msgs/MarkerArray.h>

#include <limits>
#include <map>
#include <memory>
#include <set>

#include "ChainClient.hpp"
#include "CoreChain.hpp"
#include "disparity_refinement/ros/PlaneMarkers.hpp"
#include "disparity_refinement/visualization/Colorize.hpp"
#include "disparity_refinement/visualization/PlanePatches.hpp"

namespace disparity_refinement {
namespace {

using rosgraph_msgs::Log;
using sensor_msgs::CameraInfo;
using sensor_msgs::Image;
using stereo_msgs::DisparityImage;
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

/// Everything that the chain publishes of a frame, and what the core says about it.
struct Frame {
  ros::Time stamp;
  StereoMessages pair;
  CoreResult core;
  Image::Ptr labels;
  stereo_msgs::DisparityImagePtr disparity, refined;
  PlanesPtr planes;
};

class Visualization : public testing::Test {
 protected:
  explicit Visualization(const std::string& name = "/stereo") : nh_(name) {
    publish<Image>("left/image_rect");
    publish<CameraInfo>("left/camera_info");
    publish<DisparityImage>("disparity");
    publish<DisparityImage>("disparity_refined");
    publish<Image>("labels");
    publish<Planes>("planes");
  }

  template <class Message>
  void publish(const std::string& topic) {
    publishers_[topic] = nh_.advertise<Message>(topic, 100);
  }

  std::set<std::string> subscribed() const {
    std::set<std::string> topics;
    for (const auto& [topic, publisher] : publishers_) {
      if (publisher.getNumSubscribers() > 0) topics.insert(topic);
    }
    return topics;
  }

  bool waitForInputs(const std::set<std::string>& topics) {
    return waitFor([&] { return subscribed() == topics; });
  }

  /// A frame of the street with planes of all kinds.
  Frame next() {
    Frame frame;
    frame.stamp = StereoCamera::stamp(index_);
    frame.pair = camera_.make(index_++);
    CoreParameters parameters;
    parameters.matching.disparity_range = 64;
    parameters.segmentation.lambda = 20;
    parameters.refinement.planes.min_valid_fraction = 0.5;
    parameters.refinement.planes.max_iterations = 10;
    frame.core = runCore(frame.pair, parameters);
    // Those of the refinement beyond the paper.
    for (std::size_t i = 0; i < frame.core.planes.size(); i += 2) {
      SegmentPlane& plane = frame.core.planes[i];
      if (plane.status == PlaneStatus::ACCEPTED) continue;
      plane = frame.core.planes.front();
      plane.status = PlaneStatus::OF_NEIGHBOUR;
      plane.c = 20.0;
    }
    const std_msgs::Header& header = frame.pair.left->header;
    frame.labels = StereoCamera::image(header, frame.core.labels, sensor_msgs::image_encodings::TYPE_32SC1);
    frame.disparity = disparityMessage(header, frame.core.disparity, frame.core.range);
    frame.refined = disparityMessage(header, frame.core.refined, frame.core.range);
    frame.planes = planesMessage(header, frame.core.planes);
    return frame;
  }

  stereo_msgs::DisparityImagePtr disparityMessage(const std_msgs::Header& header, const cv::Mat& map,
                                                  const DisparityRange& range) const {
    const StreetParameters& street = camera_.street().parameters();
    const auto message = makeDisparityImage(header, map.size(), {street.focal_length, street.baseline, 0.0},
                                            range, cv::Rect({0, 0}, map.size()));
    map.copyTo(imageView(message->image, "32FC1", "map"));
    return message;
  }

  /// The same frame at a later time.
  static void restamp(Frame& frame) {
    frame.stamp = StereoCamera::stamp(index_++);
    for (std_msgs::Header* header :
         {&frame.pair.left->header, &frame.pair.left_info->header, &frame.labels->header,
          &frame.disparity->header, &frame.refined->header, &frame.planes->header}) {
      header->stamp = frame.stamp;
    }
  }

  void send(const Frame& frame) {
    publishers_["left/camera_info"].publish(frame.pair.left_info);
    publishers_["left/image_rect"].publish(frame.pair.left);
    publishers_["disparity"].publish(frame.disparity);
    publishers_["labels"].publish(frame.labels);
    sendResult(frame);
  }

  void sendResult(const Frame& frame) {
    publishers_["disparity_refined"].publish(frame.refined);
    publishers_["planes"].publish(frame.planes);
  }

  /// Whether the markers are those of the core.
  bool areExpected(const MarkerArray& markers, const Frame& frame) const {
    const StreetParameters& street = camera_.street().parameters();
    const auto patches =
        findPlanePatches(frame.core.labels, frame.core.planes, {street.focal_length, street.baseline, 0.0},
                         camera_.street().principalPoint());
    // roscpp numbers the headers of what it sends.
    return markers == *planeMarkers(markers.markers.at(0).header, patches);
  }

  /// Markers of the stamp of a frame.
  static MarkerArray::ConstPtr wait(Listener<MarkerArray>& listener, const Frame& frame,
                                    double timeout = TIMEOUT) {
    return listener.wait(
        [&frame](const MarkerArray& array) { return array.markers.at(0).header.stamp == frame.stamp; },
        timeout);
  }

  /// Sends a frame with later and later stamps until its markers are accepted: the CameraInfo comes on a
  /// connection of its own.
  bool waitForMarkers(Listener<MarkerArray>& listener, Frame& frame,
                      const std::function<bool(const MarkerArray&)>& accept) {
    return waitFor([&] {
      restamp(frame);
      send(frame);
      const auto message = wait(listener, frame, 0.5);
      return message && accept(*message);
    });
  }

  bool waitForMarkers(Listener<MarkerArray>& listener) {
    Frame frame = next();
    return waitForInputs(MARKER_INPUTS) &&
           waitForMarkers(listener, frame, [](const MarkerArray&) { return true; });
  }

  /// A bad frame gives an error with all `words` and no markers, and the good frame after it has them.
  void expectRefused(Frame& bad, const std::vector<std::string>& words) {
    Listener<MarkerArray> markers(nh_, "plane_markers");
    ASSERT_TRUE(waitForMarkers(markers));
    // The log may not be connected yet, and the same error is not logged again at once.
    EXPECT_TRUE(waitFor([&] {
      restamp(bad);
      send(bad);
      return log_.waitFor(words, Log::ERROR, 1.0);
    }));
    Frame good = next();
    EXPECT_TRUE(waitForMarkers(markers, good, [](const MarkerArray&) { return true; }))
        << "the good frame after the bad one is not drawn";
    EXPECT_FALSE(wait(markers, bad, 0.0));
  }

  const std::set<std::string> MARKER_INPUTS = {"labels", "planes", "disparity_refined", "left/camera_info"};
  ros::NodeHandle nh_;
  const StereoCamera camera_{nh_, StereoCamera::smallStreet(), "not_published"};
  std::map<std::string, ros::Publisher> publishers_;
  LogListener log_{nh_};
  static int index_;
};

int Visualization::index_ = 0;

TEST_F(Visualization, drawsThePicturesOfTheCore) {
  const std::vector<std::string> topics = {"disparity_color", "disparity_refined_color", "labels_color",
                                           "segment_borders", "refused_segments"};
  std::map<std::string, std::unique_ptr<Listener<Image>>> listeners;
  for (const std::string& topic : topics) {
    listeners[topic] = std::make_unique<Listener<Image>>(nh_, topic);
  }
  ASSERT_TRUE(waitForInputs({"left/image_rect", "disparity", "disparity_refined", "labels", "planes"}));
  for (int i = 0; i < 2; ++i) {
    const Frame frame = next();
    const CoreResult& core = frame.core;
    const cv::Mat left = imageView(*frame.pair.left, "mono8", "left");
    std::map<std::string, cv::Mat> expected;
    colorizeDisparity(core.disparity, core.range, 0.0F, 64.0F, expected["disparity_color"]);
    colorizeDisparity(core.refined, core.range, 0.0F, 64.0F, expected["disparity_refined_color"]);
    colorizeLabels(core.labels, expected["labels_color"]);
    drawSegmentBorders(left, core.labels, expected["segment_borders"]);
    drawRefusedSegments(left, core.labels, core.planes, expected["refused_segments"]);
    send(frame);
    for (const std::string& topic : topics) {
      const auto message = listeners[topic]->wait(frame.stamp);
      ASSERT_TRUE(message) << topic;
      EXPECT_EQ(message->header.frame_id, "stereo_left") << topic;
      EXPECT_TRUE(sameBits(imageView(*message, "bgr8", topic), expected[topic])) << topic;
    }
    std::set<PlaneStatus> statuses;
    for (const SegmentPlane& plane : core.planes) statuses.insert(plane.status);
    EXPECT_GE(statuses.size(), 3U) << "the test says little";
  }
}

TEST_F(Visualization, drawsThePlanesOfTheCore) {
  Listener<MarkerArray> markers(nh_, "plane_markers");
  ASSERT_TRUE(waitForMarkers(markers));
  for (int i = 0; i < 2; ++i) {
    const Frame frame = next();
    send(frame);
    const auto message = wait(markers, frame);
    ASSERT_TRUE(message);
    EXPECT_TRUE(areExpected(*message, frame));
    EXPECT_EQ(message->markers.at(0).header.frame_id, "stereo_left");
    EXPECT_GT(message->markers.at(0).points.size(), 5U * 3U * PlanePatch::CORNERS) << "the test says little";
  }
}

TEST_F(Visualization, takesThePrincipalPointOfTheLeftCamera) {
  Listener<MarkerArray> markers(nh_, "plane_markers");
  ASSERT_TRUE(waitForMarkers(markers));
  Frame frame = next();
  const auto isExpected = [&](const MarkerArray& array) { return areExpected(array, frame); };
  const CameraInfo original = *frame.pair.left_info;
  frame.pair.left_info->P[2] += 30;
  EXPECT_TRUE(waitForMarkers(markers, frame, std::not_fn(isExpected)));

  // Twice the resolution, of which the image is a part.
  CameraInfo& info = *frame.pair.left_info;
  info = original;
  info.binning_x = info.binning_y = 2;
  info.roi.x_offset = 40;
  info.roi.y_offset = 20;
  for (const std::size_t i : {0, 2, 5, 6}) info.P[i] *= 2.0;
  info.P[2] += 40;
  info.P[6] += 20;
  EXPECT_TRUE(waitForMarkers(markers, frame, isExpected));
}

TEST_F(Visualization, deletesThePlanesOfTheFormerFrame) {
  Listener<MarkerArray> markers(nh_, "plane_markers");
  ASSERT_TRUE(waitForMarkers(markers));
  const Frame frame = next();
  for (Plane& plane : frame.planes->planes) plane.status = Plane::TOO_FEW_POINTS;
  send(frame);
  const auto message = wait(markers, frame);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->markers.size(), 2U);
  for (const Marker& marker : message->markers) EXPECT_EQ(marker.action, Marker::DELETE) << marker.ns;
}

template <class Message>
void expectInputs(ros::NodeHandle& nh, const std::string& output,
                  const std::function<bool(const std::set<std::string>&)>& waitForInputs,
                  const std::set<std::string>& inputs) {
  {
    const Listener<Message> listener(nh, output);
    EXPECT_TRUE(waitForInputs(inputs)) << output;
  }
  EXPECT_TRUE(waitForInputs({})) << output << " is not looked at any more";
}

TEST_F(Visualization, subscribesToWhatIsLookedAtOnly) {
  EXPECT_TRUE(waitForInputs({}));
  const auto wait = [this](const std::set<std::string>& topics) { return waitForInputs(topics); };
  expectInputs<Image>(nh_, "disparity_color", wait, {"disparity"});
  expectInputs<Image>(nh_, "disparity_refined_color", wait, {"disparity_refined"});
  expectInputs<Image>(nh_, "labels_color", wait, {"labels"});
  expectInputs<Image>(nh_, "segment_borders", wait, {"labels", "left/image_rect"});
  expectInputs<Image>(nh_, "refused_segments", wait, {"labels", "left/image_rect", "planes"});
  expectInputs<MarkerArray>(nh_, "plane_markers", wait, MARKER_INPUTS);
}

TEST_F(Visualization, waitsForPlanesThatComeLate) {
  Listener<MarkerArray> markers(nh_, "plane_markers");
  ASSERT_TRUE(waitForMarkers(markers));
  Listener<Image> borders(nh_, "segment_borders"), refused(nh_, "refused_segments");
  std::set<std::string> inputs = MARKER_INPUTS;
  inputs.insert("left/image_rect");
  ASSERT_TRUE(waitForInputs(inputs));
  // One more than cache_size.
  std::vector<Frame> frames;
  for (int i = 0; i < 4; ++i) {
    frames.push_back(next());
    publishers_["left/image_rect"].publish(frames.back().pair.left);
    publishers_["labels"].publish(frames.back().labels);
    ASSERT_TRUE(borders.wait(frames.back().stamp)) << "image and labels have come";
  }
  sendResult(frames[0]);
  for (int i = 1; i < 4; ++i) {
    sendResult(frames[i]);
    EXPECT_TRUE(refused.wait(frames[i].stamp)) << i;
    EXPECT_TRUE(wait(markers, frames[i])) << i;
  }
  EXPECT_FALSE(refused.wait(frames[0].stamp, 0.0)) << "its image and labels are forgotten";
  EXPECT_FALSE(wait(markers, frames[0], 0.0));
}

TEST_F(Visualization, namesTheTopicsOfLabelsWithoutAPlane) {
  Frame frame = next();
  frame.planes->planes.resize(3);
  expectRefused(frame, {"/stereo/labels", "/stereo/planes", "largest label", "number of planes, 3"});
}

TEST_F(Visualization, namesThePlanesOfUnknownStatus) {
  Frame frame = next();
  frame.planes->planes[1].status = 77;
  expectRefused(frame, {"/stereo/planes", "plane 1", "77", "0 to 4"});
}

TEST_F(Visualization, namesTheCameraWithoutAPrincipalPoint) {
  Frame frame = next();
  frame.pair.left_info->P[6] = std::numeric_limits<double>::quiet_NaN();
  expectRefused(frame, {"/stereo/left/camera_info", "P[6]", "nan"});
}

TEST_F(Visualization, namesTheMapWithoutGeometry) {
  Frame frame = next();
  frame.refined->T = -0.5F;
  expectRefused(frame, {"/stereo/disparity_refined", "T is -0.5"});
}

class BlindVisualization : public Visualization {
 protected:
  BlindVisualization() : Visualization("/blind") {}
};

TEST_F(BlindVisualization, asksForTheCameraInfo) {
  Listener<MarkerArray> markers(nh_, "plane_markers");
  ASSERT_TRUE(waitForInputs(MARKER_INPUTS));
  Frame frame = next();
  EXPECT_TRUE(waitFor([&] {
    restamp(frame);
    publishers_["labels"].publish(frame.labels);
    sendResult(frame);
    return log_.waitFor({"no message on /blind/left/camera_info", "/blind/plane_markers"}, Log::WARN, 1.0);
  }));
  EXPECT_EQ(markers.count(), 0U);
  EXPECT_TRUE(waitForMarkers(markers));
}

}  // namespace
}  // namespace disparity_refinement
