#include "PointCloudFile.hpp"

#include <array>
#include <cstdint>
#include <cstring>
#include <sstream>

#include "OutputFiles.hpp"
#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

/// One vertex as the file holds it.
using Vertex = std::array<char, 3 * sizeof(float) + 3>;

Vertex makeVertex(const cv::Vec3f& point, const cv::Vec3b& bgr) {
  Vertex vertex{};
  std::memcpy(vertex.data(), point.val, 3 * sizeof(float));
  const std::array<std::uint8_t, 3> rgb{bgr[2], bgr[1], bgr[0]};
  std::memcpy(vertex.data() + 3 * sizeof(float), rgb.data(), rgb.size());
  return vertex;
}

const char* byteOrder() {
  const std::uint16_t one = 1;
  char first = 0;
  std::memcpy(&first, &one, 1);
  return first == 1 ? "binary_little_endian" : "binary_big_endian";
}

}  // namespace

int writePly(const std::string& file, const cv::Mat& disparity, const DisparityRange& range,
             const cv::Mat& bgr, const ProjectionMatrix& left, const StereoGeometry& geometry) {
  requireImage(disparity, "disparity", CV_32FC1);
  requireImage(bgr, "bgr", CV_8UC3, disparity.size());
  const double fx = left[0], cx = left[2], fy = left[5], cy = left[6];
  std::string vertices;
  int count = 0;
  for (int y = 0; y < disparity.rows; ++y) {
    for (int x = 0; x < disparity.cols; ++x) {
      const float d = disparity.at<float>(y, x);
      if (!range.isValid(d) || !(d > 0.0F)) continue;
      const double z = geometry.focal_length * geometry.baseline / d;
      const cv::Vec3f point(static_cast<float>((x - cx) / fx * z), static_cast<float>((y - cy) / fy * z),
                            static_cast<float>(z));
      const Vertex vertex = makeVertex(point, bgr.at<cv::Vec3b>(y, x));
      vertices.append(vertex.data(), vertex.size());
      ++count;
    }
  }
  std::ostringstream text;
  text << "ply\nformat " << byteOrder() << " 1.0\nelement vertex " << count
       << "\nproperty float x\nproperty float y\nproperty float z\n"
          "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
       << vertices;
  writeTextFile(file, text.str());
  return count;
}

}  // namespace disparity_refinement
