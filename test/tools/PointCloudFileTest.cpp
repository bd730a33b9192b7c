#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "KittiFixture.hpp"
#include "PointCloudFile.hpp"

namespace disparity_refinement {
namespace {

constexpr DisparityRange RANGE{0.0F, 64.0F};
const ProjectionMatrix LEFT{100, 0, 10, 0, 0, 50, 20, 0, 0, 0, 1, 0};
const StereoGeometry GEOMETRY{100.0, 0.5, 0.0};

TEST(PointCloudFile, holdsEveryPixelInFrontOfTheCamera) {
  const TemporaryFolder folder;
  const std::string file = (folder / "cloud.ply").string();
  cv::Mat disparity(30, 40, CV_32FC1, cv::Scalar(-1));
  disparity.at<float>(22, 14) = 25.0F;  // Z = 100 * 0.5 / 25 = 2 m
  disparity.at<float>(0, 0) = 0.0F;     // infinitely far
  cv::Mat bgr(30, 40, CV_8UC3, cv::Scalar(0, 0, 0));
  bgr.at<cv::Vec3b>(22, 14) = {1, 2, 3};
  EXPECT_EQ(writePly(file, disparity, RANGE, bgr, LEFT, GEOMETRY), 1);

  std::ifstream stream(file, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  EXPECT_NE(text.find("element vertex 1\n"), std::string::npos);
  const auto data = text.find("end_header\n") + 11;
  ASSERT_EQ(text.size(), data + 15);
  float point[3];
  std::memcpy(point, &text[data], sizeof point);
  EXPECT_FLOAT_EQ(point[0], 2.0F * (14 - 10) / 100);
  EXPECT_FLOAT_EQ(point[1], 2.0F * (22 - 20) / 50);
  EXPECT_FLOAT_EQ(point[2], 2.0F);
  EXPECT_EQ(text.substr(data + 12), std::string("\3\2\1")) << "red, green, blue";
}

TEST(PointCloudFile, explainsWhatItCannotWrite) {
  const TemporaryFolder folder;
  const cv::Mat disparity(3, 4, CV_32FC1, cv::Scalar(5)), bgr(3, 4, CV_8UC3, cv::Scalar(0, 0, 0));
  const std::string file = (folder / "no" / "cloud.ply").string();
  EXPECT_THROW(writePly(file, disparity, RANGE, bgr, LEFT, GEOMETRY), std::runtime_error);
  EXPECT_THROW(writePly(file, disparity, RANGE, bgr.row(0), LEFT, GEOMETRY), std::invalid_argument);
  EXPECT_THROW(writePly(file, bgr, RANGE, bgr, LEFT, GEOMETRY), std::invalid_argument);
}

}  // namespace
}  // namespace disparity_refinement
