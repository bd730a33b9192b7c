#include "OutputFiles.hpp"

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace disparity_refinement {
namespace {

[[noreturn]] void fail(const std::string& file) { throw std::runtime_error("cannot write " + file); }

}  // namespace

void writeTextFile(const std::string& file, const std::string& text) {
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) fail(file);
}

void writeImageFile(const std::string& file, const cv::Mat& image) {
  bool is_written = false;
  try {
    is_written = cv::imwrite(file, image);
  } catch (const cv::Exception&) {
    // An ending that OpenCV does not know.
  }
  if (!is_written) fail(file);
}

void requireWritable(const std::string& file) {
  if (!std::ofstream(file, std::ios::app)) fail(file);
}

}  // namespace disparity_refinement
