// What the nodelets report on /diagnostics. SyncTest has what they say about pairs.

#include <gtest/gtest.h>
#include <stereo_msgs/DisparityImage.h>

#include "CoreChain.hpp"
#include "DiagnosticsClient.hpp"
#include "disparity_refinement/refinement/RefinementStatistics.hpp"

namespace disparity_refinement {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using sensor_msgs::Image;
using stereo_msgs::DisparityImage;

bool says(const DiagnosticStatus& status, const std::string& words) {
  return status.message.find(words) != std::string::npos;
}

class Rig {
 public:
  explicit Rig(const std::string& name) : nh("/" + name) {}

  /// Publishes frames, stamped now, until a report matches: it is that of the last second.
  bool drive(Diagnostics& diagnostics, const std::function<bool(const DiagnosticStatus&)>& matches,
             int index = 0) {
    const StereoMessages messages = camera.make(index);
    return waitFor([&] {
      messages.left->header.stamp = messages.right->header.stamp = ros::Time::now();
      messages.left_info->header.stamp = messages.right_info->header.stamp = messages.left->header.stamp;
      camera.publish(messages);
      return diagnostics.waitFor(matches, 0.3);
    });
  }

  ros::NodeHandle nh;
  StereoCamera camera{nh};
};

TEST(Diagnostics, tellsIdleFromStarving) {
  Rig rig("free");
  Diagnostics disparity(rig.nh, "free/disparity");
  EXPECT_TRUE(
      disparity.waitFor([](const DiagnosticStatus& status) { return says(status, "nobody listens"); }));
  {
    Listener<DisparityImage> listener(rig.nh, "disparity");
    EXPECT_TRUE(disparity.waitFor([](const DiagnosticStatus& status) { return says(status, "no input"); }));
    ASSERT_TRUE(rig.camera.waitForChain(listener));
    EXPECT_TRUE(rig.drive(disparity, [](const DiagnosticStatus& status) { return says(status, "running"); }));
  }
  EXPECT_TRUE(
      disparity.waitFor([](const DiagnosticStatus& status) { return says(status, "nobody listens"); }));
}

TEST(Diagnostics, reportsWhatTheRefinementDidToAFrame) {
  Rig rig("free");
  Listener<DisparityImage> refined(rig.nh, "disparity_refined");
  Diagnostics diagnostics(rig.nh, "free/plane_refinement");
  ASSERT_TRUE(rig.camera.waitForChain(refined));
  CoreParameters parameters;
  parameters.matching.disparity_range = 64;
  const StereoMessages messages = rig.camera.make(3);
  const CoreResult core = runCore(messages, parameters);
  const RefinementStatistics expected =
      measureRefinement(core.disparity, core.refined, core.labels, core.range, 100.0, parameters.refinement,
                        core.fitted_planes);
  ASSERT_GT(expected.too_few_points, 0);
  ASSERT_GT(expected.valid_after, expected.valid_before);

  DiagnosticStatus status;
  const std::string density = std::to_string(100.0 * expected.valid_after).substr(0, 5);
  ASSERT_TRUE(rig.drive(
      diagnostics,
      [&](const DiagnosticStatus& report) {
        status = report;
        return Diagnostics::text(report, "pixels valid after [%]").substr(0, 5) == density;
      },
      3));
  const auto number = [&status](const std::string& key) {
    const std::string text = Diagnostics::text(status, key);
    return text.empty() ? -1.0 : std::stod(text);
  };
  EXPECT_NEAR(number("pixels valid before [%]"), 100.0 * expected.valid_before, 0.01);
  EXPECT_EQ(number("segments"), expected.segments);
  const auto share = [&expected](int segments) { return 100.0 * segments / expected.segments; };
  EXPECT_NEAR(number("segments refused [%], condition 1, depth error"),
              share(expected.refused_by_depth_error), 0.01);
  EXPECT_NEAR(number("segments refused [%], condition 2, too few points"), share(expected.too_few_points),
              0.01);
  EXPECT_NEAR(number("segments refused [%], condition 3, maximum number of iterations"),
              share(expected.max_iterations), 0.01);
  EXPECT_NEAR(number("segments refused [%], condition 4, divergence"), share(expected.refused_by_divergence),
              0.01);
  EXPECT_NEAR(number("segments refused [%], no plane through their points"), share(expected.degenerate),
              0.01);
  EXPECT_EQ(status.level, DiagnosticStatus::OK) << status.message;
}

TEST(Diagnostics, countsDropsByReason) {
  Rig rig("free");
  Listener<DisparityImage> refined(rig.nh, "disparity_refined");
  Diagnostics disparity(rig.nh, "free/disparity"), planes(rig.nh, "free/plane_refinement");
  ASSERT_TRUE(rig.camera.waitForChain(refined));
  const auto check = [](const DiagnosticStatus& before, const DiagnosticStatus& after,
                        const std::string& reason, long frames) {
    EXPECT_EQ(Diagnostics::value(after, reason) - Diagnostics::value(before, reason), frames) << reason;
    EXPECT_EQ(Diagnostics::value(after, "frames received"),
              Diagnostics::value(after, "frames published") + Diagnostics::value(after, "frames dropped"));
  };

  // A pair of unequal size.
  const DiagnosticStatus disparity_before = disparity.next();
  StereoMessages bad = rig.camera.make(0);
  bad.right = StereoCamera::image(bad.right->header, cv::Mat::zeros(60, 320, CV_8UC1));
  rig.camera.publish(bad);
  EXPECT_TRUE(disparity.waitFor(
      [](const DiagnosticStatus& status) { return status.level == DiagnosticStatus::ERROR; }));
  check(disparity_before, disparity.next(), "frames dropped, bad", 1);

  // A disparity map whose labels never come.
  const DiagnosticStatus planes_before = planes.next();
  ros::Publisher foreign = rig.nh.advertise<DisparityImage>("disparity", 10);
  ASSERT_TRUE(waitFor([&] { return foreign.getNumSubscribers() >= 1; }));
  DisparityImage lonely;
  lonely.header.stamp = StereoCamera::stamp(1);
  foreign.publish(lonely);
  EXPECT_TRUE(refined.wait(rig.camera.publish(2)));
  check(planes_before, planes.next(), "frames dropped, no partner", 1);
}

TEST(Diagnostics, warnsBeyondTheBounds) {
  Rig rig("bounded");
  Listener<DisparityImage> refined(rig.nh, "disparity_refined");
  ASSERT_TRUE(rig.camera.waitForChain(refined));
  for (const char* nodelet : {"bounded/disparity", "bounded/segmentation", "bounded/plane_refinement"}) {
    Diagnostics diagnostics(rig.nh, nodelet);
    DiagnosticStatus status;
    EXPECT_TRUE(
        rig.drive(diagnostics,
                  [&status](const DiagnosticStatus& report) {
                    status = report;
                    // Not one with the stamps of waitForChain().
                    return says(report, "s old, expected at most 1e-06 s") &&
                           Diagnostics::text(report, "age at publication, mean [ms]").find("unknown") ==
                               std::string::npos;
                  }))
        << nodelet << ": " << status.message;
    EXPECT_EQ(status.level, DiagnosticStatus::WARN) << nodelet;
    EXPECT_TRUE(says(status, "Hz, expected at least 10000 Hz")) << nodelet << ": " << status.message;
    EXPECT_GE(Diagnostics::value(status, "age at publication, mean [ms]"), 0) << nodelet;
    EXPECT_GE(Diagnostics::value(status, "processing time, mean [ms]"), 0) << nodelet;
    EXPECT_GE(Diagnostics::value(status, "input rate [Hz]"), 0) << nodelet;
    EXPECT_GE(Diagnostics::value(status, "output rate [Hz]"), 0) << nodelet;
  }
  Diagnostics diagnostics(rig.nh, "bounded/plane_refinement");
  EXPECT_TRUE(rig.drive(diagnostics, [](const DiagnosticStatus& report) {
    return says(report, "% of the pixels have a disparity, expected at least 100 %");
  })) << "one pixel is always invalid";
}

}  // namespace
}  // namespace disparity_refinement
