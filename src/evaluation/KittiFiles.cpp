#include "disparity_refinement/evaluation/KittiFiles.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <locale>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

// Value of the PNG for 1 px; 0 stands for "no disparity".
constexpr float PNG_SCALE = 256.0F;

std::ifstream openFile(const std::string& path) {
  if (std::filesystem::is_directory(path)) throw std::runtime_error(path + " is a folder, expected a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot open " + path);
  return file;
}

cv::Mat readImage(const std::string& path, int flags) {
  std::ifstream file = openFile(path);
  const std::vector<uchar> bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  cv::Mat image;
  try {
    if (!bytes.empty()) image = cv::imdecode(bytes, flags);
  } catch (const cv::Exception&) {
    // Refused by the decoder: reported below like everything else that is no image.
  }
  if (image.empty()) throw std::runtime_error(path + " is not a readable image");
  return image;
}

}  // namespace

cv::Mat readDisparityPng(const std::string& path) {
  const cv::Mat png = readImage(path, cv::IMREAD_UNCHANGED);
  if (png.type() != CV_16UC1)
    throw std::runtime_error(path + " has type " + cv::typeToString(png.type()) +
                             ", expected a 16-bit gray PNG (CV_16UC1)");
  cv::Mat disparity;
  png.convertTo(disparity, CV_32FC1, 1.0 / PNG_SCALE);
  return disparity;
}

cv::Mat roundToKittiPng(const cv::Mat& disparity, const DisparityRange& range) {
  requireImage(disparity, "disparity", CV_32FC1);
  cv::Mat rounded(disparity.size(), CV_32FC1);
  for (int y = 0; y < disparity.rows; ++y) {
    const float* row = disparity.ptr<float>(y);
    std::transform(row, row + disparity.cols, rounded.ptr<float>(y), [&range](float d) {
      if (!range.isValid(d)) return 0.0F;
      return std::round(std::clamp(d, KITTI_PNG_RANGE.min, KITTI_PNG_RANGE.max) * PNG_SCALE) / PNG_SCALE;
    });
  }
  return rounded;
}

void writeDisparityPng(const std::string& path, const cv::Mat& disparity, const DisparityRange& range) {
  cv::Mat png;
  roundToKittiPng(disparity, range).convertTo(png, CV_16UC1, PNG_SCALE);
  std::vector<uchar> bytes;
  cv::imencode(".png", png, bytes);
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw std::runtime_error("cannot write " + path);
}

ProjectionMatrix readProjectionMatrix(const std::string& path, const std::string& key) {
  std::ifstream file = openFile(path);
  const std::string prefix = key + ":";
  std::string line;
  while (std::getline(file, line)) {
    if (line.compare(0, prefix.size(), prefix) != 0) continue;
    std::istringstream numbers(line.substr(prefix.size()));
    numbers.imbue(std::locale::classic());
    ProjectionMatrix matrix{};
    for (double& entry : matrix) numbers >> entry;
    if (numbers && (numbers >> std::ws).eof()) return matrix;
    std::ostringstream message;
    message << path << ": " << key << " does not hold exactly 12 numbers";
    throw std::runtime_error(message.str());
  }
  throw std::runtime_error(path + ": no line starts with \"" + prefix + "\"");
}

cv::Mat readGrayImage(const std::string& path) { return readImage(path, cv::IMREAD_GRAYSCALE); }

cv::Mat readColorImage(const std::string& path) { return readImage(path, cv::IMREAD_COLOR); }

void requireSizeOfLeftImage(const std::string& path, const cv::Mat& image, const cv::Size& left) {
  if (image.size() == left) return;
  const auto text = [](const cv::Size& size) {
    return std::to_string(size.width) + "x" + std::to_string(size.height);
  };
  throw std::runtime_error(path + ": " + text(image.size()) + " pixels, expected " + text(left) +
                           " as the left image");
}

}  // namespace disparity_refinement
