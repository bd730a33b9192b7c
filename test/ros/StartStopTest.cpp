// Nodelets and listeners that come and go in any order, while frames flow.

#include <gtest/gtest.h>
#include <nodelet/NodeletLoad.h>
#include <nodelet/NodeletUnload.h>
#include <stereo_msgs/DisparityImage.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "ChainClient.hpp"
#include "CoreChain.hpp"
#include "ManagerProcess.hpp"
#include "disparity_refinement/Planes.h"

namespace disparity_refinement {
namespace {

using sensor_msgs::Image;
using stereo_msgs::DisparityImage;

const std::vector<std::string> NODELETS = {"disparity", "segmentation", "plane_refinement", "depth",
                                           "visualization"};

/// Those of start_stop.test.
CoreParameters testParameters() {
  CoreParameters parameters;
  parameters.matching.stereo_algorithm = StereoAlgorithm::CENSUS_SGM;
  parameters.matching.disparity_range = 64;
  parameters.matching.full_width = true;
  parameters.refinement.mode = RefinementMode::QUALITY;
  return parameters;
}

void load(const std::string& nodelet) {
  nodelet::NodeletLoad call;
  call.request.name = "/stereo/" + nodelet;
  call.request.type = "disparity_refinement/" + nodelet;
  ASSERT_TRUE(ros::service::call("/manager/load_nodelet", call)) << nodelet;
  ASSERT_TRUE(call.response.success) << nodelet;
}

void unload(const std::string& nodelet) {
  nodelet::NodeletUnload call;
  call.request.name = "/stereo/" + nodelet;
  ASSERT_TRUE(ros::service::call("/manager/unload_nodelet", call)) << nodelet;
  ASSERT_TRUE(call.response.success) << nodelet;
}

class StartStop : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(ros::service::waitForService("/manager/load_nodelet", ros::Duration(TIMEOUT)));
    manager_ = pidOf("/manager");
    ASSERT_GT(manager_, 0);
  }

  void TearDown() override { EXPECT_EQ(pidOf("/manager"), manager_) << "the manager has died"; }

  /// Whoever listens now hears of frames that are sent from now on.
  void expectFrames() {
    Listener<DisparityImage> refined(nh_, "disparity_refined");
    Listener<Image> depth(nh_, "depth/image_rect"), borders(nh_, "segment_borders");
    const ros::Time now = camera_.lastStamp();
    const auto isNew = [&now](const auto& message) { return message.header.stamp > now; };
    EXPECT_TRUE(refined.wait(isNew)) << "no refined map";
    EXPECT_TRUE(depth.wait(isNew)) << "no depth";
    EXPECT_TRUE(borders.wait(isNew)) << "no picture of the segments";
    EXPECT_EQ(camera_.countWrongPairs(refined), 0);
  }

  template <class Message>
  void comeAndGo(const std::string& topic, bool connect) {
    const Listener<Message> listener(nh_, topic);
    if (!connect) return;
    EXPECT_TRUE(waitFor([&listener] { return listener.isConnected(); })) << topic;
  }

  /// What is left behind every one of `times` times is too much: a thread, a file, or memory for a frame.
  void expectNoGrowth(const ProcessSize& before, int times, const std::string& what) {
    ProcessSize now;
    // Connections end a while after their listeners.
    waitFor(
        [&] {
          now = sizeOf(manager_);
          return now.threads <= before.threads && now.files <= before.files;
        },
        2.0);
    std::cout << what << ", " << times << " times: threads " << before.threads << " -> " << now.threads
              << ", files " << before.files << " -> " << now.files << ", memory " << before.memory << " -> "
              << now.memory << " kB\n";
    EXPECT_LT(now.threads, before.threads + times / 2) << what;
    EXPECT_LT(now.files, before.files + times / 2) << what;
    EXPECT_LT(now.memory, before.memory + 10000) << what;
  }

  int manager_ = 0;
  ros::NodeHandle nh_{"/stereo"};
  KnownCamera camera_{nh_, testParameters()};
};

TEST_F(StartStop, nodeletsAloneDoTheirShare) {
  for (const std::string& nodelet : NODELETS) {
    load(nodelet);
    {
      Listener<DisparityImage> raw(nh_, "disparity"), refined(nh_, "disparity_refined");
      Listener<Image> labels(nh_, "labels"), depth(nh_, "depth/image_rect"), borders(nh_, "segment_borders");
      const Driver driver(camera_);
      const bool is_done = waitFor([&] { return raw.count() + labels.count() > 3; },
                                   nodelet == "disparity" || nodelet == "segmentation" ? TIMEOUT : 1.0);
      EXPECT_EQ(is_done, nodelet == "disparity" || nodelet == "segmentation") << nodelet;
      EXPECT_EQ(raw.count() > 0, nodelet == "disparity") << nodelet;
      EXPECT_EQ(labels.count() > 0, nodelet == "segmentation") << nodelet;
      EXPECT_EQ(refined.count() + depth.count() + borders.count(), 0U) << nodelet;
    }
    unload(nodelet);
  }
}

TEST_F(StartStop, nodeletsStartInAnyOrder) {
  const Driver driver(camera_);
  // Each of them first, last and next to every other.
  std::vector<std::string> order = NODELETS;
  for (int direction = 0; direction < 2; ++direction) {
    for (std::size_t i = 0; i < order.size(); ++i) {
      std::rotate(order.begin(), order.begin() + 1, order.end());
      SCOPED_TRACE(testing::PrintToString(order));
      for (const std::string& nodelet : order) {
        load(nodelet);
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
      }
      expectFrames();
      for (const std::string& nodelet : order) unload(nodelet);
    }
    std::reverse(order.begin(), order.end());
  }
}

TEST_F(StartStop, nodeletIsLoadedAgainAndAgain) {
  constexpr int TIMES = 10;
  for (const std::string& nodelet : NODELETS) load(nodelet);
  Listener<DisparityImage> refined(nh_, "disparity_refined");
  const Listener<Image> depth(nh_, "depth/image_rect"), borders(nh_, "segment_borders");
  const Driver driver(camera_);
  expectFrames();
  for (const std::string& nodelet : NODELETS) {
    // Even if it is unloaded in the middle of a callback.
    const auto expectParameters = [&nodelet] {
      const std::string service = "/stereo/" + nodelet + "/set_parameters";
      EXPECT_EQ(ros::service::exists(service, false), nodelet != "depth") << service;
    };
    // The first time costs what is only made once.
    unload(nodelet);
    load(nodelet);
    expectFrames();
    const ProcessSize before = sizeOf(manager_);
    for (int i = 0; i < TIMES; ++i) {
      unload(nodelet);
      load(nodelet);
      // At another moment of a frame each time.
      std::this_thread::sleep_for(std::chrono::milliseconds(7 * i));
      expectParameters();
    }
    expectFrames();
    expectNoGrowth(before, TIMES, nodelet);
  }
  EXPECT_EQ(camera_.countWrongPairs(refined), 0);
  for (const std::string& nodelet : NODELETS) unload(nodelet);
}

TEST_F(StartStop, listenersComeAndGoAThousandTimes) {
  for (const std::string& nodelet : NODELETS) load(nodelet);
  const Driver driver(camera_);
  expectFrames();

  const std::function<void(bool)> COME_AND_GO[] = {
      [this](bool connect) { comeAndGo<DisparityImage>("disparity_refined", connect); },
      [this](bool connect) { comeAndGo<Planes>("planes", connect); },
      [this](bool connect) { comeAndGo<Image>("confidence", connect); },
      [this](bool connect) { comeAndGo<DisparityImage>("disparity", connect); },
      [this](bool connect) { comeAndGo<Image>("labels", connect); },
      [this](bool connect) { comeAndGo<Image>("depth/image_rect", connect); },
      [this](bool connect) { comeAndGo<Image>("disparity_color", connect); },
      [this](bool connect) { comeAndGo<Image>("segment_borders", connect); },
  };
  // One listener of every topic at a time. Most leave before they are connected, or when they have just been.
  const auto churn = [&COME_AND_GO](int times) {
    std::vector<std::thread> threads;
    for (const auto& come_and_go : COME_AND_GO) {
      threads.emplace_back([&come_and_go, times] {
        for (int i = 0; i < times; ++i) come_and_go(i % 3 == 0);
      });
    }
    for (std::thread& thread : threads) thread.join();
    return times * static_cast<int>(std::size(COME_AND_GO));
  };
  churn(15);
  expectFrames();
  const ProcessSize before = sizeOf(manager_);
  const int times = churn(143);
  ASSERT_GE(times, 1000);
  expectFrames();
  expectNoGrowth(before, times, "listeners");
  for (const std::string& nodelet : NODELETS) unload(nodelet);
}

}  // namespace
}  // namespace disparity_refinement
