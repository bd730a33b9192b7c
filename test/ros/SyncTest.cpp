// Stamps: pairs that never match, pairs that almost match, time that jumps back, and more frames than time.

#include <gtest/gtest.h>
#include <stereo_msgs/DisparityImage.h>

#include "ChainClient.hpp"
#include "DiagnosticsClient.hpp"

namespace disparity_refinement {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using sensor_msgs::Image;
using stereo_msgs::DisparityImage;

/// A chain in a namespace, with a camera in front of it and listeners behind it.
class Chain {
 public:
  explicit Chain(const std::string& name, const StreetParameters& street = StereoCamera::smallStreet())
      : nh("/" + name), camera(nh, street), frame_(camera.street().render(0)) {}

  bool connect() { return camera.waitForChain(refined); }

  StereoMessages make(int index, double right_offset = 0.0) const {
    StereoMessages messages = camera.make(frame_.left, frame_.right, StereoCamera::stamp(index));
    messages.right->header.stamp += ros::Duration(right_offset);
    messages.right_info->header.stamp = messages.right->header.stamp;
    return messages;
  }

  ros::Time publish(int index, double right_offset = 0.0) {
    camera.publish(make(index, right_offset));
    return StereoCamera::stamp(index);
  }

  ros::NodeHandle nh;
  StereoCamera camera;
  Listener<DisparityImage> raw{nh, "disparity"}, refined{nh, "disparity_refined"};
  Listener<Image> labels{nh, "labels"};

 private:
  const StreetFrame frame_;
};

TEST(ExactSync, reportsThatNothingMatches) {
  Chain chain("exact");
  LogListener log(chain.nh);
  Diagnostics diagnostics(chain.nh, "exact/disparity");
  ASSERT_TRUE(chain.connect());

  int index = 0;
  const std::vector<std::string> words = {
      "/exact/left/image_rect ",   "/exact/left/camera_info ",       "/exact/right/image_rect ",
      "/exact/right/camera_info ", "no synchronized stereo pair",    "differ by at least 0.003 s",
      "~approximate_sync",         "~approximate_sync_max_interval",
  };
  EXPECT_TRUE(waitFor([&] {
    chain.publish(index++, 0.003);
    return log.waitFor(words, rosgraph_msgs::Log::WARN, 0.1);
  }));
  // Each topic with its number of messages.
  const auto line = log.messages().wait(
      [](const rosgraph_msgs::Log& message) {
        return message.msg.find("no synchronized stereo pair") != std::string::npos &&
               message.msg.find("differ by at least") != std::string::npos;
      },
      0.0);
  ASSERT_TRUE(line);
  for (const char* topic : {"left/image_rect", "left/camera_info", "right/image_rect", "right/camera_info"}) {
    const std::string name = std::string("/exact/") + topic + " ";
    EXPECT_GT(std::stoi(line->msg.substr(line->msg.find(name) + name.size())), 0) << topic;
  }
  EXPECT_TRUE(diagnostics.waitFor([](const DiagnosticStatus& status) {
    return status.level == DiagnosticStatus::WARN &&
           status.message.find("differ by at least 0.003 s") != std::string::npos;
  }));

  // A pair that matches ends it.
  const ros::Time stamp = chain.publish(index++);
  EXPECT_TRUE(chain.refined.wait(stamp));
  EXPECT_TRUE(diagnostics.waitFor([](const DiagnosticStatus& status) {
    return status.level == DiagnosticStatus::OK && Diagnostics::value(status, "pairs") > 0;
  }));
}

TEST(ExactSync, reportsATopicWithoutMessages) {
  Chain chain("exact");
  LogListener log(chain.nh);
  ASSERT_TRUE(chain.connect());
  ros::Publisher left = chain.nh.advertise<Image>("left/image_rect", 10);
  int index = 0;
  EXPECT_TRUE(waitFor([&] {
    left.publish(chain.make(index++).left);
    return log.waitFor(
        {"no synchronized stereo pair", "/exact/right/image_rect 0", "check the names and remaps"},
        rosgraph_msgs::Log::WARN, 0.1);
  }));
  EXPECT_TRUE(chain.refined.wait(chain.publish(index++)));
}

TEST(ApproximateSync, doesNotWaitForTheNextPair) {
  Chain chain("approximate");
  ASSERT_TRUE(chain.connect());
  // One pair only, with the right image 3 ms later, and one with the left image later.
  EXPECT_TRUE(chain.refined.wait(chain.publish(0, 0.003)));
  EXPECT_TRUE(chain.refined.wait(chain.publish(1, -0.003)));
  EXPECT_TRUE(chain.refined.wait(chain.publish(2)));
}

TEST(ApproximateSync, rejectsPairsThatAreTooFarApart) {
  Chain chain("approximate");
  Diagnostics diagnostics(chain.nh, "approximate/disparity");
  ASSERT_TRUE(chain.connect());
  ASSERT_TRUE(chain.refined.wait(chain.publish(0)));
  const char* key = "images without a partner";
  const long unpaired = Diagnostics::value(diagnostics.next(), key);
  ASSERT_GE(unpaired, 0);

  const ros::Time apart = chain.publish(1, 0.05);
  // The frames after it are processed, each without a further one.
  for (int i = 2; i < 5; ++i) EXPECT_TRUE(chain.refined.wait(chain.publish(i, 0.003))) << "frame " << i;
  EXPECT_FALSE(chain.raw.wait(apart, 0.0));
  EXPECT_EQ(Diagnostics::value(diagnostics.next(), key), unpaired + 2);
}

/// Plays frames in a loop, as `rosbag play --loop` does, a few of them on their way at any time. Every loop
/// ends with left images that have no partner: without care they fill the queues against what is earlier.
void expectAllOfEveryLoop(Chain& chain, int frames, double right_offset) {
  constexpr int LOOPS = 3, UNDER_WAY = 2, UNPAIRED = 10;
  ros::Publisher left = chain.nh.advertise<Image>("left/image_rect", 100);
  ASSERT_TRUE(chain.connect());
  ASSERT_TRUE(chain.refined.wait(chain.publish(-1, right_offset)));
  for (int loop = 0; loop < LOOPS; ++loop) {
    for (auto* listener : {&chain.raw, &chain.refined}) listener->clear();
    for (int i = 0; i < frames; ++i) {
      chain.publish(i, right_offset);
      if (i >= UNDER_WAY) {
        ASSERT_TRUE(chain.refined.wait(StereoCamera::stamp(i - UNDER_WAY))) << "loop " << loop << ", " << i;
      }
    }
    ASSERT_TRUE(chain.refined.wait(StereoCamera::stamp(frames - 1))) << "the end of loop " << loop;
    for (int i = 0; i < frames; ++i) {
      EXPECT_TRUE(chain.raw.wait(StereoCamera::stamp(i))) << "loop " << loop << ", " << i;
      EXPECT_TRUE(chain.refined.wait(StereoCamera::stamp(i), 0.0)) << "loop " << loop << ", " << i;
    }
    EXPECT_EQ(chain.refined.count(), static_cast<std::size_t>(frames)) << "loop " << loop;
    for (int i = 0; i < UNPAIRED; ++i) left.publish(chain.make(frames + i).left);
  }
}

TEST(ExactSync, followsTimeThatJumpsBack) {
  Chain chain("exact");
  for (const int frames : {8, 2}) expectAllOfEveryLoop(chain, frames, 0.0);
}

TEST(ApproximateSync, followsTimeThatJumpsBack) {
  Chain chain("approximate");
  for (const int frames : {8, 2}) expectAllOfEveryLoop(chain, frames, 0.003);
}

TEST(ExactSync, playsASinglePairAgainAndAgain) {
  Chain chain("exact");
  ASSERT_TRUE(chain.connect());
  for (int loop = 0; loop < 3; ++loop) {
    for (auto* listener : {&chain.raw, &chain.refined}) listener->clear();
    const ros::Time stamp = chain.publish(0);
    EXPECT_TRUE(chain.raw.wait(stamp)) << "loop " << loop;
    EXPECT_TRUE(chain.refined.wait(stamp)) << "loop " << loop;
  }
}

TEST(Overload, dropsAndCountsTheOldestFrames) {
  constexpr int FRAMES = 10;
  StreetParameters street;  // 640x240
  Chain chain("slow", street);
  Diagnostics diagnostics(chain.nh, "slow/disparity");
  ASSERT_TRUE(chain.connect());
  ASSERT_TRUE(chain.refined.wait(chain.publish(-1)));
  const DiagnosticStatus before = diagnostics.next();
  ASSERT_GE(Diagnostics::value(before, "frames dropped"), 0);

  for (auto* listener : {&chain.raw, &chain.refined}) listener->clear();
  chain.labels.clear();
  std::vector<StereoMessages> burst;
  for (int i = 0; i < FRAMES; ++i) burst.push_back(chain.make(i));
  for (const StereoMessages& messages : burst) {
    chain.camera.publish(messages);
    // Far less than the matcher takes, enough for the messages to arrive one after the other.
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  const ros::Time newest = StereoCamera::stamp(FRAMES - 1);
  EXPECT_TRUE(chain.raw.wait(newest));
  EXPECT_TRUE(chain.labels.wait(newest));
  EXPECT_TRUE(chain.refined.wait(newest)) << "disparity and labels of the newest frame are joined";
  EXPECT_LT(chain.raw.count(), static_cast<std::size_t>(FRAMES));

  // Nothing is under way any more: every frame that was received is published or counted as dropped.
  const DiagnosticStatus after = diagnostics.next();
  const auto added = [&](const char* key) {
    return Diagnostics::value(after, key) - Diagnostics::value(before, key);
  };
  EXPECT_GT(added("frames dropped"), 0);
  EXPECT_EQ(added("frames received"), added("frames published") + added("frames dropped"));
  EXPECT_EQ(added("frames published"), static_cast<long>(chain.raw.count()));
}

}  // namespace
}  // namespace disparity_refinement
