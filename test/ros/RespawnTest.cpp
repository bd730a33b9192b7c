// Processes of the launch file that are killed while frames flow, with respawn:=true.

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <sensor_msgs/PointCloud2.h>
#include <signal.h>
#include <stereo_msgs/DisparityImage.h>

#include <chrono>
#include <map>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "ChainClient.hpp"
#include "CoreChain.hpp"
#include "ManagerProcess.hpp"

namespace disparity_refinement {
namespace {

/// Heartbeats of a dead process are missed after four seconds; only then does the other side let go.
constexpr double RESPAWN_TIMEOUT = 60.0;

class Respawn : public testing::Test {
 protected:
  static CoreParameters testParameters() {
    CoreParameters parameters;
    parameters.matching.stereo_algorithm = StereoAlgorithm::CENSUS_SGM;
    parameters.matching.disparity_range = 64;
    parameters.matching.full_width = true;
    parameters.matching.aggregate_rows = true;
    parameters.refinement.mode = RefinementMode::QUALITY;
    return parameters;
  }

  void expectFrames() {
    const ros::Time now = camera_.lastStamp();
    EXPECT_TRUE(
        refined_.wait([&now](const auto& message) { return message.header.stamp > now; }, RESPAWN_TIMEOUT));
    EXPECT_EQ(camera_.countWrongPairs(refined_), 0);
    refined_.clear();
  }

  void killNodes(const std::vector<std::string>& nodes) {
    // The bond of a nodelet and its manager notices a death from the second heartbeat on, of which one comes
    // a second.
    std::this_thread::sleep_for(std::chrono::seconds(3));
    for (const std::string& node : nodes) {
      int pid = 0;
      ASSERT_TRUE(waitFor([&] {
        pid = pidOf("/stereo/" + node);
        return pid > 0;
      })) << node;
      ASSERT_EQ(kill(pid, SIGKILL), 0) << node;
    }
  }

  /// What a nodelet has published since it was loaded, by its next report; -1 if none comes.
  long countPublished(const std::string& nodelet) {
    long count = -1;
    diagnostics_.clear();
    diagnostics_.wait([&](const diagnostic_msgs::DiagnosticArray& array) {
      for (const auto& status : array.status) {
        if (status.name.find("stereo/" + nodelet) == std::string::npos) continue;
        for (const auto& value : status.values) {
          if (value.key == "frames published") count = std::stol(value.value);
        }
      }
      return count >= 0;
    });
    return count;
  }

  ros::NodeHandle nh_{"/stereo"};
  KnownCamera camera_{nh_, testParameters()};
  Listener<stereo_msgs::DisparityImage> refined_{nh_, "disparity_refined"};
  Listener<diagnostic_msgs::DiagnosticArray> diagnostics_{nh_, "/diagnostics"};
  Driver driver_{camera_};
};

TEST_F(Respawn, bringsBackEveryNodelet) {
  const std::vector<std::string> nodelets = {"disparity", "segmentation", "plane_refinement"};
  expectFrames();
  killNodes(nodelets);
  // A nodelet goes on until the manager misses the process that has loaded it. The new process fails to load
  // it until then, and is started again.
  std::map<std::string, long> published;
  std::set<std::string> reloaded;
  EXPECT_TRUE(waitFor(
      [&] {
        for (const std::string& nodelet : nodelets) {
          const long count = countPublished(nodelet);
          if (count >= 0 && count < published[nodelet]) reloaded.insert(nodelet);
          published[nodelet] = count;
        }
        return reloaded.size() == nodelets.size();
      },
      RESPAWN_TIMEOUT))
      << testing::PrintToString(reloaded);
  expectFrames();
}

TEST_F(Respawn, bringsBackManagerAndStandaloneNodelet) {
  Listener<sensor_msgs::PointCloud2> points(nh_, "points2");
  const auto expectPoints = [&] {
    const ros::Time now = camera_.lastStamp();
    EXPECT_TRUE(points.wait([&now](const auto& cloud) { return cloud.header.stamp > now; }, RESPAWN_TIMEOUT));
    points.clear();
  };
  expectFrames();
  expectPoints();
  killNodes({"refinement_manager", "point_cloud"});
  expectFrames();
  expectPoints();
}

}  // namespace
}  // namespace disparity_refinement
