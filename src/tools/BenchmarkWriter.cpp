#include "BenchmarkWriter.hpp"

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "disparity_refinement/evaluation/KittiFiles.hpp"

namespace disparity_refinement {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 4> FOLDERS{"image_0", "image_1", "disp_noc", "calib"};

void writeImage(const std::string& file, const cv::Mat& image) {
  if (!cv::imwrite(file, image)) throw std::runtime_error("cannot write " + file);
}

void writeMatrix(std::ostream& out, const char* key, const ProjectionMatrix& matrix) {
  out << key << ":";
  for (const double entry : matrix) out << " " << entry;
  out << "\n";
}

}  // namespace

BenchmarkWriter::BenchmarkWriter(const std::string& folder, bool overwrite) : folder_(folder) {
  for (const char* name : FOLDERS) {
    const fs::path path = fs::path(folder) / name;
    if (fs::exists(path) && !overwrite) {
      throw std::runtime_error(path.string() + " exists already, expected a new folder or --force");
    }
    fs::remove_all(path);
    fs::create_directories(path);
  }
}

void BenchmarkWriter::write(const cv::Mat& left, const cv::Mat& right, const cv::Mat& disparity,
                            const ProjectionMatrix& left_projection,
                            const ProjectionMatrix& right_projection) {
  char number[16];
  std::snprintf(number, sizeof number, "%06d", frames_++);
  const auto file = [&](const char* name, const char* end) {
    return (fs::path(folder_) / name / (number + std::string(end))).string();
  };
  writeImage(file("image_0", "_10.png"), left);
  writeImage(file("image_1", "_10.png"), right);
  writeDisparityPng(file("disp_noc", "_10.png"), disparity,
                    {std::numeric_limits<float>::min(), std::numeric_limits<float>::max()});
  const std::string calibration = file("calib", ".txt");
  std::ofstream stream(calibration);
  stream.precision(std::numeric_limits<double>::max_digits10);
  writeMatrix(stream, "P0", left_projection);
  writeMatrix(stream, "P1", right_projection);
  stream.close();
  if (!stream) throw std::runtime_error("cannot write " + calibration);
}

}  // namespace disparity_refinement
