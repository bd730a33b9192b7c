#include "disparity_refinement/evaluation/KittiFiles.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
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
constexpr float PNG_MIN = 1.0F;
constexpr float PNG_MAX = 65535.0F;

std::ifstream openFile(const std::string& path) {
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

void writeDisparityPng(const std::string& path, const cv::Mat& disparity, const DisparityRange& range) {
  requireImage(disparity, "disparity", CV_32FC1);
  cv::Mat png(disparity.size(), CV_16UC1);
  for (int y = 0; y < disparity.rows; ++y) {
    for (int x = 0; x < disparity.cols; ++x) {
      const float d = disparity.at<float>(y, x);
      png.at<std::uint16_t>(y, x) =
          range.isValid(d)
              ? static_cast<std::uint16_t>(std::lround(std::clamp(d * PNG_SCALE, PNG_MIN, PNG_MAX)))
              : std::uint16_t{0};
    }
  }
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

}  // namespace disparity_refinement
