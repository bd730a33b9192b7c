#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "disparity_refinement/evaluation/KittiFiles.hpp"

namespace disparity_refinement {
namespace {

constexpr DisparityRange RANGE{0.0F, 300.0F};

/// A file that is removed at the end of the test.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& name)
      : path_(testing::TempDir() + "KittiFilesTest_" + std::to_string(getpid()) + "_" + name) {}
  ~TemporaryFile() { unlink(path_.c_str()); }

  const std::string& path() const { return path_; }

  void write(const std::string& text) const { std::ofstream(path_, std::ios::binary) << text; }

 private:
  std::string path_;
};

template <typename Function>
std::string errorOf(Function function) {
  try {
    function();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

void expectNames(const std::string& error, const std::string& part) {
  EXPECT_NE(error.find(part), std::string::npos) << "\"" << error << "\" does not name \"" << part << "\"";
}

TEST(KittiFiles, disparityPngHoldsRoundedMultiplesOf256) {
  const TemporaryFile file("disparity.png");
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const cv::Mat map =
      (cv::Mat_<float>(2, 5) << -1, 0, 1, 127.9375F, 0.001F, nan, 10.4F / 256, 10.6F / 256, 300, inf);
  const cv::Mat expected = (cv::Mat_<std::uint16_t>(2, 5) << 0, 1, 256, 32752, 1, 0, 10, 11, 65535, 0);
  writeDisparityPng(file.path(), map, RANGE);
  const cv::Mat png = cv::imread(file.path(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(png.type(), CV_16UC1);
  EXPECT_EQ(cv::norm(png, expected, cv::NORM_INF), 0.0) << png;
}

TEST(KittiFiles, negativeValidDisparitiesBecomeTheSmallestValue) {
  const TemporaryFile file("negative.png");
  const cv::Mat map = (cv::Mat_<float>(1, 3) << -9, -8, 3);
  writeDisparityPng(file.path(), map, DisparityRange{-8.0F, 120.0F});
  const cv::Mat expected = (cv::Mat_<float>(1, 3) << 0, 1.0F / 256, 3);
  EXPECT_EQ(cv::norm(readDisparityPng(file.path()), expected, cv::NORM_INF), 0.0);
}

TEST(KittiFiles, roundingIsWhatAPngGivesBack) {
  const TemporaryFile file("rounded.png");
  cv::Mat map(40, 50, CV_32FC1);
  cv::RNG random(1);
  random.fill(map, cv::RNG::UNIFORM, -3.0, 300.0);
  map.at<float>(0, 0) = std::numeric_limits<float>::quiet_NaN();
  map.at<float>(0, 1) = std::numeric_limits<float>::infinity();
  const DisparityRange range{-2.0F, 126.0F};
  writeDisparityPng(file.path(), map, range);
  const cv::Mat rounded = roundToKittiPng(map, range);
  EXPECT_EQ(cv::norm(rounded, readDisparityPng(file.path()), cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(rounded, roundToKittiPng(rounded, KITTI_PNG_RANGE), cv::NORM_INF), 0.0)
      << "once is enough";
  EXPECT_THROW(roundToKittiPng(cv::Mat(2, 2, CV_16SC1), range), std::invalid_argument);
}

TEST(KittiFiles, sizesAreComparedWithTheLeftImage) {
  const cv::Mat image(3, 4, CV_8UC1);
  EXPECT_NO_THROW(requireSizeOfLeftImage("a.png", image, {4, 3}));
  try {
    requireSizeOfLeftImage("a.png", image, {5, 3});
    ADD_FAILURE() << "nothing was thrown";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "a.png: 4x3 pixels, expected 5x3 as the left image");
  }
}

TEST(KittiFiles, disparityPngIsReadInPixels) {
  const TemporaryFile file("read.png");
  const cv::Mat png = (cv::Mat_<std::uint16_t>(1, 4) << 0, 1, 384, 65535);
  cv::imwrite(file.path(), png);
  const cv::Mat disparity = readDisparityPng(file.path());
  ASSERT_EQ(disparity.type(), CV_32FC1);
  const cv::Mat expected = (cv::Mat_<float>(1, 4) << 0, 1.0F / 256, 1.5F, 65535.0F / 256);
  EXPECT_EQ(cv::norm(disparity, expected, cv::NORM_INF), 0.0);
}

TEST(KittiFiles, readingNamesTheFileThatIsNoDisparityPng) {
  const TemporaryFile missing("missing.png"), eight_bit("8bit.png"), colour("colour.png"), text("text.png"),
      empty("empty.png");
  cv::imwrite(eight_bit.path(), cv::Mat(2, 2, CV_8UC1, cv::Scalar(1)));
  cv::imwrite(colour.path(), cv::Mat(2, 2, CV_16UC3, cv::Scalar(1, 2, 3)));
  text.write("not an image");
  empty.write("");
  for (const TemporaryFile* file : {&missing, &eight_bit, &colour, &text, &empty})
    expectNames(errorOf([file] { readDisparityPng(file->path()); }), file->path());
  expectNames(errorOf([&] { readDisparityPng(eight_bit.path()); }), "CV_8UC1");
  expectNames(errorOf([&] { readDisparityPng(colour.path()); }), "CV_16UC3");
}

TEST(KittiFiles, writingNamesTheFileItCannotWrite) {
  const std::string path = testing::TempDir() + "no/such/folder/map.png";
  const cv::Mat map(1, 1, CV_32FC1, cv::Scalar(1));
  expectNames(errorOf([&] { writeDisparityPng(path, map, RANGE); }), path);
  const TemporaryFile file("type.png");
  EXPECT_THROW(writeDisparityPng(file.path(), cv::Mat(1, 1, CV_64FC1, cv::Scalar(1)), RANGE),
               std::invalid_argument);
  EXPECT_THROW(writeDisparityPng(file.path(), cv::Mat(), RANGE), std::invalid_argument);
}

TEST(KittiFiles, readsTheMatrixOfItsKeyOnly) {
  const TemporaryFile file("calib.txt");
  file.write(
      "calib_time: 09-Jan-2012 13:57:47\n"
      "P0: 7.070912e+02 0.0 6.018873e+02 0 0 7.070912e+02 1.831104e+02 0 0 0 1 0\n"
      "P_rect_02: 1 2 3 4 5 6 7 8 9 10 11 -3.797842e+02 \r\n"
      "P_rect_02_old: 0 0 0 0 0 0 0 0 0 0 0 0\n");
  const ProjectionMatrix p0{707.0912, 0, 601.8873, 0, 0, 707.0912, 183.1104, 0, 0, 0, 1, 0};
  const ProjectionMatrix p2{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, -379.7842};
  EXPECT_EQ(readProjectionMatrix(file.path(), "P0"), p0);
  EXPECT_EQ(readProjectionMatrix(file.path(), "P_rect_02"), p2);
}

TEST(KittiFiles, readsALastLineWithoutANewline) {
  const TemporaryFile file("unterminated.txt");
  file.write("P1: 1 2 3 4 5 6 7 8 9 10 11 12");
  EXPECT_EQ(readProjectionMatrix(file.path(), "P1")[11], 12.0);
}

TEST(KittiFiles, calibrationErrorsNameFileAndKey) {
  const TemporaryFile missing("none.txt"), file("short.txt");
  file.write(
      "P0: 1 2 3 4 5 6 7 8 9 10 11\nP1: 1 2 3 4 5 6 7 8 9 10 11 12 13\nP2: 1 2 3 4 five 6 7 8 9 10 11 12\n");
  expectNames(errorOf([&] { readProjectionMatrix(missing.path(), "P0"); }), missing.path());
  for (const std::string key : {"P0", "P1", "P2", "P3", "P"}) {
    const std::string error = errorOf([&] { readProjectionMatrix(file.path(), key); });
    expectNames(error, file.path());
    expectNames(error, key);
  }
}

TEST(KittiFiles, grayImagesAreConvertedFromColour) {
  const TemporaryFile gray("gray.png"), colour("bgr.png"), missing("image.png");
  cv::imwrite(gray.path(), cv::Mat(3, 4, CV_8UC1, cv::Scalar(77)));
  cv::imwrite(colour.path(), cv::Mat(3, 4, CV_8UC3, cv::Scalar(90, 90, 90)));
  EXPECT_EQ(cv::countNonZero(readGrayImage(gray.path()) == 77), 12);
  EXPECT_EQ(cv::countNonZero(readGrayImage(colour.path()) == 90), 12);
  expectNames(errorOf([&] { readGrayImage(missing.path()); }), missing.path());
}

}  // namespace
}  // namespace disparity_refinement
