#pragma once

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>

namespace disparity_refinement {

/// A folder that is removed with everything in it at the end of the test.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "disparity_refinement_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot create " + name);
    path_ = name;
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  std::string string() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

inline void writeText(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

/// What the exception says, empty without one.
template <class Step>
std::string refusal(const Step& step) {
  try {
    step();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

/// A gray image of one value.
inline void writeGray(const std::filesystem::path& file, int value, const cv::Size& size = {64, 48}) {
  std::filesystem::create_directories(file.parent_path());
  cv::imwrite(file.string(), cv::Mat(size, CV_8UC1, cv::Scalar(value)));
}

inline std::string numbered(int number, int digits, const std::string& end) {
  const std::string text = std::to_string(number);
  return std::string(static_cast<std::size_t>(digits) - text.size(), '0') + text + end;
}

/// Focal length and principal point of the fixtures [px].
constexpr double FIXTURE_F = 100.0, FIXTURE_CX = 31.5, FIXTURE_CY = 23.5;

/// A line of a calibration file.
inline std::string projectionLine(const std::string& key, double fourth_entry) {
  char line[200];
  std::snprintf(line, sizeof(line), "%s: %e 0 %e %e 0 %e %e 0 0 0 1 0\n", key.c_str(), FIXTURE_F, FIXTURE_CX,
                fourth_entry, FIXTURE_F, FIXTURE_CY);
  return line;
}

/// P0...P3 as KITTI has them: the fourth entry of the left colour camera is not 0.
inline std::string calibration(const std::string& prefix) {
  return projectionLine(prefix + "0", 0.0) + projectionLine(prefix + "1", -50.0) +
         projectionLine(prefix + "2", 6.0) + projectionLine(prefix + "3", -44.0);
}

/// Three frames; the gray value of an image is 10 * frame + camera.
inline void writeOdometry(const std::filesystem::path& folder) {
  for (int camera = 0; camera < 4; ++camera) {
    for (int i = 0; i < 3; ++i) {
      writeGray(folder / ("image_" + std::to_string(camera)) / numbered(i, 6, ".png"), 10 * i + camera);
    }
  }
  writeText(folder / "calib.txt", calibration("P"));
  writeText(folder / "times.txt", "0.000000e+00\n1.037360e-01\n2.074720e-01\n");
}

/// Two frames; the right camera is 0.5 ms late.
inline void writeRaw(const std::filesystem::path& drive) {
  for (int camera = 0; camera < 4; ++camera) {
    const std::filesystem::path folder = drive / ("image_0" + std::to_string(camera));
    for (int i = 0; i < 2; ++i) writeGray(folder / "data" / numbered(i, 10, ".png"), 10 * i + camera);
    writeText(folder / "timestamps.txt",
              camera % 2 == 0 ? "2011-09-26 13:02:25.964389445\n2011-09-26 13:02:26.068000000\n"
                              : "2011-09-26 13:02:25.964889445\n2011-09-26 13:02:26.068500000\n");
  }
  writeText(drive.parent_path() / "calib_cam_to_cam.txt",
            "calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.950000e-02\n" + calibration("P_rect_0"));
}

/// Frames 000000 and 000004 of different size, with an image _11 that is not part of the stereo benchmark.
inline void writeBenchmark(const std::filesystem::path& folder) {
  for (const int number : {0, 4}) {
    const cv::Size size(64 + number, 48);
    const std::string name = numbered(number, 6, "_10.png");
    for (int camera = 0; camera < 4; ++camera) {
      const std::filesystem::path images = folder / ("image_" + std::to_string(camera));
      writeGray(images / name, 10 * number + camera, size);
      writeGray(images / numbered(number, 6, "_11.png"), 255, size);
    }
    writeText(folder / "calib" / numbered(number, 6, ".txt"), calibration("P"));
    for (const std::string kind : {"disp_noc", "disp_occ"}) {
      cv::Mat truth(size, CV_16UC1, cv::Scalar(0));
      truth.at<std::uint16_t>(5, 7) = kind == "disp_noc" ? 640 : 1280;  // 2.5 px and 5 px
      std::filesystem::create_directories(folder / kind);
      cv::imwrite((folder / kind / name).string(), truth);
    }
  }
}

}  // namespace disparity_refinement
