#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>

#include "disparity_refinement/ros/StereoGeometry.hpp"

namespace disparity_refinement {
namespace {

sensor_msgs::CameraInfo cameraInfo(double f, double cx, double tx) {
  sensor_msgs::CameraInfo info;
  info.P = {f, 0, cx, tx, 0, f, 100, 0, 0, 0, 1, 0};
  return info;
}

/// What the exception says, empty without one.
std::string refusal(const sensor_msgs::CameraInfo& left, const sensor_msgs::CameraInfo& right) {
  try {
    stereoGeometry(left, right);
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "";
}

TEST(StereoGeometry, readsTheProjectionMatrixAlone) {
  // K, D and R are empty.
  const StereoGeometry geometry = stereoGeometry(cameraInfo(400, 320, 0), cameraInfo(400, 320, -200));
  EXPECT_EQ(geometry.focal_length, 400.0);
  EXPECT_EQ(geometry.baseline, 0.5);
  EXPECT_EQ(geometry.principal_point_offset, 0.0);
}

TEST(StereoGeometry, takesTheLeftTermToo) {
  // As in KITTI's colour pair: both cameras are relative to a third one.
  EXPECT_EQ(stereoGeometry(cameraInfo(512, 320, 32), cameraInfo(512, 320, -240)).baseline, 0.53125);
  EXPECT_EQ(stereoGeometry(cameraInfo(512, 320, -32), cameraInfo(512, 320, -240)).baseline, 0.40625);
}

TEST(StereoGeometry, givesTheOffsetOfAVergedRig) {
  EXPECT_EQ(stereoGeometry(cameraInfo(400, 325.25, 0), cameraInfo(400, 320, -200)).principal_point_offset,
            5.25);
}

TEST(StereoGeometry, scalesByBinning) {
  sensor_msgs::CameraInfo left = cameraInfo(400, 330, 0), right = cameraInfo(400, 320, -200);
  left.binning_x = left.binning_y = right.binning_x = right.binning_y = 2;
  const StereoGeometry geometry = stereoGeometry(left, right);
  EXPECT_EQ(geometry.focal_length, 200.0);
  EXPECT_EQ(geometry.baseline, 0.5) << "metres do not shrink";
  EXPECT_EQ(geometry.principal_point_offset, 5.0);
}

TEST(StereoGeometry, takesBinningZeroForOne) {
  sensor_msgs::CameraInfo left = cameraInfo(400, 320, 0);
  left.binning_x = 1;
  const StereoGeometry geometry = stereoGeometry(left, cameraInfo(400, 320, -200));
  EXPECT_EQ(geometry.focal_length, 400.0);
  EXPECT_EQ(geometry.baseline, 0.5);
}

TEST(StereoGeometry, shiftsByTheRegionOfInterest) {
  sensor_msgs::CameraInfo left = cameraInfo(400, 320, 0), right = cameraInfo(400, 320, -200);
  left.roi.x_offset = 16;
  right.roi.x_offset = 40;
  EXPECT_EQ(stereoGeometry(left, right).principal_point_offset, 24.0);
  // The region is given in pixels before binning.
  left.binning_x = right.binning_x = 2;
  EXPECT_EQ(stereoGeometry(left, right).principal_point_offset, 12.0);
  right.roi.x_offset = 16;
  EXPECT_EQ(stereoGeometry(left, right).principal_point_offset, 0.0);
}

TEST(StereoGeometry, refusesAFocalLengthThatIsNotPositive) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double f : {0.0, -400.0, nan}) {
    EXPECT_NE(refusal(cameraInfo(f, 320, 0), cameraInfo(400, 320, -200)).find("P[0]"), std::string::npos)
        << f;
    EXPECT_NE(refusal(cameraInfo(400, 320, 0), cameraInfo(f, 320, -200)).find("P[0]"), std::string::npos)
        << f;
  }
  const std::string text = refusal(cameraInfo(0, 320, 0), cameraInfo(400, 320, -200));
  EXPECT_NE(text.find("0 (left) and 400 (right)"), std::string::npos) << text;
}

TEST(StereoGeometry, refusesPrincipalPointsThatAreFarApart) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double cx : {nan, 1e7, -1e300}) {
    EXPECT_NE(refusal(cameraInfo(400, cx, 0), cameraInfo(400, 320, -200)).find("P[2]"), std::string::npos)
        << cx;
    EXPECT_NE(refusal(cameraInfo(400, 320, 0), cameraInfo(400, cx, -200)).find("P[2]"), std::string::npos)
        << cx;
  }
}

TEST(StereoGeometry, refusesABaselineThatIsNotPositive) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double tx : {0.0, 200.0, nan}) {
    const std::string text = refusal(cameraInfo(400, 320, 0), cameraInfo(400, 320, tx));
    EXPECT_NE(text.find("P_right[3]"), std::string::npos) << tx;
  }
  const std::string text = refusal(cameraInfo(400, 320, 0), cameraInfo(400, 320, 200));
  EXPECT_NE(text.find("(0 - 200) / 400"), std::string::npos) << text;
}

}  // namespace
}  // namespace disparity_refinement
