#include "BenchmarkWriter.hpp"

#include <array>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "OutputFiles.hpp"
#include "disparity_refinement/evaluation/KittiFiles.hpp"

namespace disparity_refinement {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 4> FOLDERS{"image_0", "image_1", "disp_noc", "calib"};

void writeMatrix(std::ostream& out, const char* key, const ProjectionMatrix& matrix) {
  out << key << ":";
  for (const double entry : matrix) out << " " << entry;
  out << "\n";
}

}  // namespace

BenchmarkWriter::BenchmarkWriter(const std::string& folder) : folder_(folder) {
  if (folder.empty()) throw std::runtime_error("the name of the folder is empty");
  // What is there may be a data set that nobody wants to lose.
  if (fs::exists(folder) && !(fs::is_directory(folder) && fs::is_empty(folder))) {
    throw std::runtime_error(folder + " exists already, expected a new or an empty folder");
  }
  for (const char* name : FOLDERS) fs::create_directories(fs::path(folder) / name);
}

void BenchmarkWriter::write(const cv::Mat& left, const cv::Mat& right, const cv::Mat& disparity,
                            const ProjectionMatrix& left_projection,
                            const ProjectionMatrix& right_projection) {
  char number[16];
  std::snprintf(number, sizeof number, "%06d", frames_++);
  const auto file = [&](const char* name, const char* end) {
    return (fs::path(folder_) / name / (number + std::string(end))).string();
  };
  writeImageFile(file("image_0", "_10.png"), left);
  writeImageFile(file("image_1", "_10.png"), right);
  writeDisparityPng(file("disp_noc", "_10.png"), disparity,
                    {std::numeric_limits<float>::min(), std::numeric_limits<float>::max()});
  std::ostringstream stream;
  stream.precision(std::numeric_limits<double>::max_digits10);
  writeMatrix(stream, "P0", left_projection);
  writeMatrix(stream, "P1", right_projection);
  writeTextFile(file("calib", ".txt"), stream.str());
}

}  // namespace disparity_refinement
