// Cameras that have trouble with the time: stamps that are missing, stand still, jump or lie apart, and
// messages that do not come or come in bursts. Whatever happens, no map is made of images of different
// frames, the log says what to do, and of the good frames that follow the second comes out at the latest.

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "ChainClient.hpp"
#include "CoreChain.hpp"

namespace disparity_refinement {
namespace {

using rosgraph_msgs::Log;

using Spoil = std::function<void(StereoMessages&)>;

void setStamp(StereoMessages& messages, const ros::Time& stamp) {
  messages.left->header.stamp = messages.right->header.stamp = stamp;
  messages.left_info->header.stamp = messages.right_info->header.stamp = stamp;
}

/// By the chain's name in time_faults.test.
class TimeFault : public testing::TestWithParam<std::string> {
 protected:
  static void TearDownTestSuite() { rigs_.clear(); }

  void SetUp() override {
    std::unique_ptr<Rig>& rig = rigs_[GetParam()];
    if (!rig) {
      rig = std::make_unique<Rig>(GetParam(), parameters());
      ASSERT_TRUE(rig->camera.camera.waitForChain(rig->refined));
    }
    rig_ = rig.get();
  }

  static bool isQuality() { return GetParam().find("quality") != std::string::npos; }
  static bool isApproximate() { return GetParam().find("approximate") != std::string::npos; }
  static std::string topic(const std::string& name) { return "/" + GetParam() + "/" + name; }

  static CoreParameters parameters() {
    CoreParameters parameters;
    parameters.matching.disparity_range = 64;
    parameters.matching.full_width = isQuality();
    if (isQuality()) parameters.refinement.mode = RefinementMode::QUALITY;
    return parameters;
  }

  KnownCamera& camera() { return rig_->camera; }
  Listener<stereo_msgs::DisparityImage>& refined() { return rig_->refined; }

  /// A frame whose right image and CameraInfo are stamped later by `seconds`.
  StereoMessages makeApart(int index, double seconds) {
    StereoMessages messages = camera().make(index);
    messages.right->header.stamp += ros::Duration(seconds);
    messages.right_info->header.stamp = messages.right->header.stamp;
    return messages;
  }

  /// Whether the refined map of a frame arrives.
  bool arrives(int index) { return refined().wait(StereoCamera::stamp(index)) != nullptr; }

  /// No two frames of a chain have the same.
  int nextIndex() { return rig_->index++; }

  /// Sends spoilt frames until every line is in the log, which is given by words that it holds. The same line
  /// comes every five seconds only: no two tests wait for one.
  void expectLog(int level, const std::vector<std::vector<std::string>>& lines, const Spoil& spoil) {
    std::size_t found = 0;
    EXPECT_TRUE(waitFor([&] {
      StereoMessages messages = camera().make(nextIndex());
      spoil(messages);
      camera().camera.publish(messages);
      while (found < lines.size() && rig_->log.waitFor(lines[found], level, 0.1)) ++found;
      return found == lines.size();
    })) << testing::PrintToString(lines[std::min(found, lines.size() - 1)]);
    rig_->log.clear();
  }

  void publishSpoilt(const Spoil& spoil) {
    for (int i = 0; i < 3; ++i) {
      StereoMessages messages = camera().make(nextIndex());
      spoil(messages);
      camera().camera.publish(messages);
    }
  }

  void expectRecovery() {
    for (const int i : {nextIndex(), nextIndex()}) camera().publish(i);
    EXPECT_TRUE(arrives(rig_->index - 1)) << "no frame comes out after the fault";
    EXPECT_EQ(camera().countWrongPairs(refined()), 0);
    refined().clear();
  }

  struct Rig {
    Rig(const std::string& name, const CoreParameters& parameters) : nh("/" + name), camera(nh, parameters) {}
    ros::NodeHandle nh;
    KnownCamera camera;
    Listener<stereo_msgs::DisparityImage> refined{nh, "disparity_refined"};
    LogListener log{nh};
    int index = 0;
  };
  static std::map<std::string, std::unique_ptr<Rig>> rigs_;
  Rig* rig_ = nullptr;
};

std::map<std::string, std::unique_ptr<TimeFault::Rig>> TimeFault::rigs_;

/// The same stamp for all four messages, or for one of them.
std::vector<Spoil> stampFaults(const ros::Time& stamp) {
  return {
      [stamp](StereoMessages& messages) { messages.left->header.stamp = stamp; },
      [stamp](StereoMessages& messages) { messages.right->header.stamp = stamp; },
      [stamp](StereoMessages& messages) { messages.left_info->header.stamp = stamp; },
      [stamp](StereoMessages& messages) { messages.right_info->header.stamp = stamp; },
      [stamp](StereoMessages& messages) { setStamp(messages, stamp); },
  };
}

TEST_P(TimeFault, stampThatIsNoTimeIsRefused) {
  const std::pair<ros::Time, std::string> STAMPS[] = {
      {ros::Time(), "the stamp is 0, "},
      {ros::Time(2147483648U, 0), "the stamp is beyond the year 2038, "},
      {ros::TIME_MAX, ""},  // the same line again
  };
  for (const auto& [stamp, text] : STAMPS) {
    const std::vector<Spoil> faults = stampFaults(stamp);
    const std::string end = ": " + text + "expected the time of exposure";
    if (!text.empty()) {
      expectLog(Log::ERROR,
                {{"/disparity] " + topic("left/image_rect") + end},
                 {"/disparity] " + topic("left/camera_info") + end},
                 {"/disparity] " + topic("right/image_rect") + end},
                 {"/disparity] " + topic("right/camera_info") + end},
                 {"/segmentation] " + topic("left/image_rect") + end}},
                faults.back());
    }
    for (const Spoil& spoil : faults) {
      publishSpoilt(spoil);
      EXPECT_FALSE(refined().wait(stamp, 0.0));
      expectRecovery();
    }
    rig_->log.clear();
  }
}

TEST_P(TimeFault, stampThatStandsStillIsRefused) {
  const int good = nextIndex();
  camera().publish(good);
  ASSERT_TRUE(arrives(good));
  const std::string end = ": several images with the same stamp, expected the time of exposure of each";
  expectLog(Log::ERROR,
            {{"/disparity] " + topic("left/image_rect") + end},
             {"/disparity] " + topic("right/image_rect") + end},
             {"/segmentation] " + topic("left/image_rect") + end}},
            [good](StereoMessages& messages) { setStamp(messages, StereoCamera::stamp(good)); });
  expectRecovery();
}

TEST_P(TimeFault, stampOfACoarseClockIsThatOfItsFirstFrame) {
  constexpr int TICKS = 4, FRAMES = 3;
  for (int tick = 0; tick < TICKS; ++tick) {
    const int first = nextIndex();
    camera().publish(first);
    for (int i = 1; i < FRAMES; ++i) {
      StereoMessages messages = camera().make(nextIndex());
      setStamp(messages, StereoCamera::stamp(first));
      camera().camera.publish(messages);
    }
    EXPECT_TRUE(arrives(first)) << "tick " << tick;
  }
  expectRecovery();
}

TEST_P(TimeFault, pairThatIsPlayedAgainAndAgainIsRefinedEveryTime) {
  const int index = nextIndex();
  for (int loop = 0; loop < 3; ++loop) {
    camera().publish(index);
    EXPECT_TRUE(arrives(index)) << "loop " << loop;
    EXPECT_EQ(camera().countWrongPairs(refined()), 0);
    refined().clear();
  }
  expectRecovery();
}

TEST_P(TimeFault, stampThatJumpsForASingleFrameIsFollowed) {
  for (const double jump : {3600.0, -600.0}) {
    StereoMessages messages = camera().make(nextIndex());
    setStamp(messages, messages.left->header.stamp + ros::Duration(jump));
    camera().camera.publish(messages);
    const auto jumped = refined().wait(messages.left->header.stamp);
    EXPECT_TRUE(jumped && camera().isOfOnePair(*jumped)) << jump;
    refined().clear();
    expectRecovery();

    messages = camera().make(nextIndex());
    messages.left->header.stamp += ros::Duration(jump);
    camera().camera.publish(messages);
    expectRecovery();
  }
}

TEST_P(TimeFault, camerasApartByAMillisecond) {
  const auto spoil = [this](StereoMessages& messages) { messages = makeApart(rig_->index - 1, 0.001); };
  if (isApproximate()) {
    for (int i = 0; i < 5; ++i) {
      const int index = nextIndex();
      camera().camera.publish(makeApart(index, 0.001));
      EXPECT_TRUE(arrives(index));
    }
  } else {
    expectLog(Log::WARN,
              {{"no synchronized stereo pair", topic("left/image_rect"), topic("right/image_rect"),
                "differ by at least 0.001 s", "set ~approximate_sync to true",
                "~approximate_sync_max_interval above"}},
              spoil);
    EXPECT_EQ(refined().count(), 0U);
  }
  expectRecovery();
}

TEST_P(TimeFault, camerasApartByHalfAPeriodMakeNoPair) {
  expectLog(Log::WARN,
            {{"no synchronized stereo pair", "differ by at least 0.05 s", "follow each other in 0.1 s",
              "trigger both cameras at the same time"}},
            [this](StereoMessages& messages) { messages = makeApart(rig_->index - 1, 0.05); });
  EXPECT_EQ(refined().count(), 0U);
  expectRecovery();
}

TEST_P(TimeFault, cameraInfoApartFromItsImageIsReported) {
  expectLog(Log::WARN,
            {{"no synchronized stereo pair", "the stamps of " + topic("right/camera_info"),
              topic("right/image_rect") + " differ by at least 0.02 s",
              "let the driver give a camera_info the stamp of its image"}},
            [](StereoMessages& messages) { messages.right_info->header.stamp += ros::Duration(0.02); });
  expectRecovery();
}

TEST_P(TimeFault, cameraThatIsMissingIsReported) {
  const std::pair<std::string, Spoil> FAULTS[] = {
      {"left/image_rect", [](StereoMessages& messages) { messages.left.reset(); }},
      {"right/image_rect", [](StereoMessages& messages) { messages.right.reset(); }},
      {"left/camera_info", [](StereoMessages& messages) { messages.left_info.reset(); }},
      {"right/camera_info", [](StereoMessages& messages) { messages.right_info.reset(); }},
  };
  for (const auto& [name, spoil] : FAULTS) {
    expectLog(Log::WARN, {{"no synchronized stereo pair", topic(name) + " 0", "a topic without messages"}},
              spoil);
    EXPECT_EQ(refined().count(), 0U) << name;
    expectRecovery();
  }
  // A whole camera.
  expectLog(Log::WARN, {{topic("right/image_rect") + " 0", topic("right/camera_info") + " 0"}},
            [](StereoMessages& messages) {
              messages.right.reset();
              messages.right_info.reset();
            });
  expectRecovery();
}

TEST_P(TimeFault, camerasThatComeInBursts) {
  // More than any queue of the chain holds, and fewer.
  for (const int frames : {40, 10, 10}) {
    std::vector<StereoMessages> lefts, rights;
    for (int i = 0; i < frames; ++i) {
      const StereoMessages messages = camera().make(nextIndex());
      lefts.push_back({messages.left, nullptr, messages.left_info, nullptr});
      rights.push_back({nullptr, messages.right, nullptr, messages.right_info});
    }
    for (const StereoMessages& messages : lefts) camera().camera.publish(messages);
    for (const StereoMessages& messages : rights) camera().camera.publish(messages);
    EXPECT_TRUE(arrives(rig_->index - 1)) << "the newest frame of a burst of " << frames;
    expectRecovery();
  }
}

INSTANTIATE_TEST_SUITE_P(Chain, TimeFault,
                         testing::Values("exact_paper", "exact_quality", "approximate_quality"),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace disparity_refinement
