// KITTI's files: images and disparity maps, whole, damaged or of other formats, and calibrations.

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "Input.hpp"
#include "KittiFixture.hpp"
#include "disparity_refinement/evaluation/KittiFiles.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

const TemporaryFolder& folder() {
  static const TemporaryFolder folder;
  return folder;
}

std::string written(const std::string& name, const std::string& bytes) {
  const std::string path = (folder() / name).string();
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

// A file of some format, or any bytes.
std::string imageOf(Input& input) {
  if (input.oneIn(4)) return input.bytes().ConsumeRemainingBytesAsString();
  const int type = input.oneOf({CV_16UC1, CV_16UC1, CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC3});
  const cv::Size size = input.size(24, 16);
  cv::Mat image(size, type);
  input.fillGray(image);
  std::vector<std::uint8_t> bytes;
  const std::string format = input.oneOf<std::string>({".png", ".png", ".png", ".pgm", ".bmp", ".ppm"});
  try {
    cv::imencode(format, image, bytes);
  } catch (const cv::Exception&) {
    return "";
  }
  std::string text(bytes.begin(), bytes.end());
  for (int i = input.oneIn(2) ? input.number(0, 4) : 0; i > 0 && !text.empty(); --i) {
    text[input.number(0, static_cast<int>(text.size()) - 1)] = input.bytes().ConsumeIntegral<char>();
  }
  if (input.oneIn(6)) text.resize(input.number(0, static_cast<int>(text.size())));
  return text;
}

void testImages(Input& input) {
  const std::string path = written("image.png", imageOf(input));
  cv::Mat image;
  // What is read by one is refused by no other but for its type.
  if (succeeds<std::runtime_error>([&] { image = readGrayImage(path); }, path)) {
    require(image.type() == CV_8UC1 && !image.empty(), "gray images are gray");
  }
  if (succeeds<std::runtime_error>([&] { image = readColorImage(path); }, path)) {
    require(image.type() == CV_8UC3 && !image.empty(), "colour images have colours");
  }
  if (succeeds<std::runtime_error>([&] { image = readDisparityPng(path); }, path)) {
    require(image.type() == CV_32FC1 && !image.empty(), "disparity maps have disparities");
    for (const float d : cv::Mat_<float>(image)) {
      require(d >= 0.0F && d <= KITTI_PNG_RANGE.max && d * 256.0F == std::round(d * 256.0F),
              "disparities are of 16 bits");
    }
    succeeds<std::runtime_error>([&] { requireSizeOfLeftImage(path, image, input.size(24, 16)); }, path);
  }
}

void testMaps(Input& input) {
  const DisparityRange range = input.range();
  const Picture map = input.disparity(input.size(24, 16), range);
  const std::string path = (folder() / "map.png").string();
  if (!succeeds([&] { writeDisparityPng(path, map.mat(), range); })) return;
  require(same(readDisparityPng(path), roundToKittiPng(map.mat(), range)),
          "a PNG gives back the rounded map");
}

std::string calibrationOf(Input& input) {
  if (input.oneIn(3)) return input.bytes().ConsumeRemainingBytesAsString();
  std::string text;
  for (int line = input.number(1, 4); line > 0; --line) {
    text += input.oneOf<std::string>({"P0", "P1", "P_rect_00", "P0:", "", " P0"}) +
            input.oneOf<std::string>({":", ": ", " ", ""});
    for (int i = input.oneIn(6) ? input.number(0, 14) : 12; i > 0; --i) {
      text += input.oneIn(4) ? input.oneOf<std::string>({"nan", "inf", "-1e400", "1e-400", "0x1p3", "1,5",
                                                         "1e", "+7", "--1", "\t", "\r"})
                             : std::to_string(input.anyNumber<double>());
      text += input.oneIn(12) ? input.text(3) : " ";
    }
    text += input.oneOf<std::string>({"\n", "\r\n", "", "\n\n"});
  }
  return text;
}

void testCalibration(Input& input) {
  const std::string key = input.oneOf<std::string>({"P0", "P1", "P_rect_00", ""});
  const std::string path = written("calib.txt", calibrationOf(input));
  ProjectionMatrix matrix;
  if (!succeeds<std::runtime_error>([&] { matrix = readProjectionMatrix(path, key); }, path)) return;
  for (const double entry : matrix) require(std::isfinite(entry), "matrices are finite");
}

}  // namespace

void test(Input& input) {
  switch (input.number(0, 3)) {
    case 0:
      testCalibration(input);
      break;
    case 1:
      testMaps(input);
      break;
    default:
      testImages(input);
  }
}

}  // namespace fuzz
}  // namespace disparity_refinement
