#include "disparity_refinement/evaluation/KittiDataset.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <locale>
#include <set>
#include <sstream>
#include <stdexcept>
#include <tuple>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t SECOND = 1000000000;          // [ns]
constexpr std::int64_t EPOCH = 1316995200 * SECOND;  // 2011-09-26 00:00:00 UTC

template <typename... Parts>
[[noreturn]] void fail(const fs::path& file, const Parts&... expected) {
  std::ostringstream message;
  message << file.string() << ": ";
  (message << ... << expected);
  throw std::runtime_error(message.str());
}

void requireFile(const fs::path& file, const std::string& role) {
  if (!fs::is_regular_file(file)) fail(file, "no such file, expected ", role);
}

bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// Names of the files in a folder, sorted.
std::vector<std::string> listFiles(const fs::path& folder, const std::string& end) {
  if (!fs::is_directory(folder)) fail(folder, "no such folder, expected images *", end);
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (endsWith(name, end)) names.push_back(name);
  }
  if (names.empty()) fail(folder, "no image, expected files *", end);
  std::sort(names.begin(), names.end());
  return names;
}

/// Pairs the images of two folders by their names.
std::vector<KittiFrame> pairImages(const fs::path& left, const fs::path& right, const std::string& end) {
  std::vector<KittiFrame> frames;
  for (const std::string& name : listFiles(left, end)) {
    KittiFrame frame;
    frame.name = fs::path(name).stem().string();
    frame.left = (left / name).string();
    frame.right = (right / name).string();
    requireFile(frame.right, "the right image to " + frame.left);
    frames.push_back(frame);
  }
  for (const std::string& name : listFiles(right, end)) {
    requireFile(left / name, "the left image to " + (right / name).string());
  }
  return frames;
}

/// Reads the seconds of a line of times.txt as [ns].
bool parseSeconds(const std::string& line, std::int64_t& time) {
  std::istringstream stream(line);
  stream.imbue(std::locale::classic());
  double seconds = 0.0;
  if (!(stream >> seconds) || !(stream >> std::ws).eof() || !(std::abs(seconds) < 1e9)) return false;
  time = std::llround(seconds * static_cast<double>(SECOND));
  return true;
}

/// Reads a date such as "2011-09-26 13:02:25.964389445", taken as UTC, as [ns since 1970].
bool parseDate(const std::string& line, std::int64_t& time) {
  std::tm date{};
  int end = 0;
  if (std::sscanf(line.c_str(), "%4d-%2d-%2d %2d:%2d:%2d%n", &date.tm_year, &date.tm_mon, &date.tm_mday,
                  &date.tm_hour, &date.tm_min, &date.tm_sec, &end) != 6) {
    return false;
  }
  // What a ros::Time holds, in years.
  if (date.tm_year < 1970 || date.tm_year > 2105) return false;
  date.tm_year -= 1900;
  date.tm_mon -= 1;
  std::tm normalized = date;
  time = timegm(&normalized) * SECOND;
  // A month or a second that does not exist is moved to another one.
  const auto fields = [](const std::tm& t) {
    return std::tie(t.tm_mon, t.tm_mday, t.tm_hour, t.tm_min, t.tm_sec);
  };
  if (fields(normalized) != fields(date)) return false;
  std::string fraction = line.substr(static_cast<std::size_t>(end));
  fraction.erase(fraction.find_last_not_of(" \r") + 1);
  if (fraction.empty()) return true;
  const bool has_digits_only = fraction.find_first_not_of("0123456789", 1) == std::string::npos;
  if (fraction.front() != '.' || !has_digits_only || fraction.size() > 10) return false;
  fraction.resize(10, '0');
  time += std::stoll(fraction.substr(1));
  return true;
}

/// Sets a stamp of every frame from the line that its file's number says, the first line being number 0.
void readStamps(const fs::path& file, bool (*parse)(const std::string&, std::int64_t&), std::int64_t offset,
                const std::string& example, std::int64_t KittiFrame::*stamp,
                std::vector<KittiFrame>& frames) {
  requireFile(file, "the times of the images");
  std::ifstream stream(file);
  std::vector<std::int64_t> times;
  for (std::string line; std::getline(stream, line);) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    times.emplace_back();
    if (!parse(line, times.back())) {
      fail(file, "line ", times.size(), " is \"", line, "\", expected a time like ", example);
    }
  }
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::string& name = frames[i].name;
    if (name.size() > 10 || name.find_first_not_of("0123456789") != std::string::npos) {
      fail(frames[i].left, "expected a number as name");
    }
    const std::size_t number = std::stoull(name);
    if (number >= times.size()) {
      fail(file, times.size(), " times, expected at least ", number + 1, " for image ", frames[i].left);
    }
    frames[i].*stamp = offset + times[number];
    if (i > 0 && frames[i].*stamp <= frames[i - 1].*stamp) {
      fail(file, "line ", number + 1, " is not later than that of image ", frames[i - 1].left);
    }
  }
}

struct Projections {
  ProjectionMatrix left, right;

  void assignTo(KittiFrame& frame) const {
    frame.left_projection = left;
    frame.right_projection = right;
  }
};

Projections readProjections(const fs::path& file, const std::string& left_key, const std::string& right_key) {
  requireFile(file, "the calibration of the cameras");
  return {readProjectionMatrix(file.string(), left_key), readProjectionMatrix(file.string(), right_key)};
}

/// Digits of the cameras in the names of files and matrices.
struct CameraNames {
  std::string left, right;
};

std::vector<KittiFrame> openOdometry(const fs::path& folder, const CameraNames& camera) {
  std::vector<KittiFrame> frames =
      pairImages(folder / ("image_" + camera.left), folder / ("image_" + camera.right), ".png");
  const Projections projections =
      readProjections(folder / "calib.txt", "P" + camera.left, "P" + camera.right);
  readStamps(folder / "times.txt", parseSeconds, EPOCH, "1.037360e-01", &KittiFrame::left_stamp, frames);
  for (KittiFrame& frame : frames) {
    projections.assignTo(frame);
    frame.right_stamp = frame.left_stamp;
  }
  return frames;
}

std::vector<KittiFrame> openRaw(const fs::path& folder, const CameraNames& camera) {
  const fs::path left = folder / ("image_0" + camera.left), right = folder / ("image_0" + camera.right);
  std::vector<KittiFrame> frames = pairImages(left / "data", right / "data", ".png");
  // The archives keep the calibration beside the drives of a day.
  const fs::path name = "calib_cam_to_cam.txt";
  const fs::path calibration = fs::exists(folder / name) ? folder / name : folder / ".." / name;
  const Projections projections =
      readProjections(calibration, "P_rect_0" + camera.left, "P_rect_0" + camera.right);
  for (KittiFrame& frame : frames) projections.assignTo(frame);
  const std::string example = "2011-09-26 13:02:25.964389445";
  readStamps(left / "timestamps.txt", parseDate, 0, example, &KittiFrame::left_stamp, frames);
  readStamps(right / "timestamps.txt", parseDate, 0, example, &KittiFrame::right_stamp, frames);
  return frames;
}

/// Image, calibration and ground truth of one frame of the stereo benchmark, whether or not they exist.
struct BenchmarkFiles {
  fs::path folder;
  CameraNames camera;

  KittiFrame open(const std::string& name) const {
    KittiFrame frame = openGroundTruth(name);
    frame.left = image(camera.left, name, "left");
    frame.right = image(camera.right, name, "right");
    const std::string number = name.substr(0, name.find('_'));
    readProjections(folder / "calib" / (number + ".txt"), "P" + camera.left, "P" + camera.right)
        .assignTo(frame);
    return frame;
  }

  KittiFrame openGroundTruth(const std::string& name) const {
    KittiFrame frame;
    frame.name = fs::path(name).stem().string();
    frame.disp_noc = groundTruth("disp_noc", name);
    frame.disp_occ = groundTruth("disp_occ", name);
    return frame;
  }

  fs::path images(const std::string& camera_name) const { return folder / ("image_" + camera_name); }

 private:
  std::string image(const std::string& camera_name, const std::string& name, const std::string& side) const {
    const fs::path file = images(camera_name) / name;
    requireFile(file, "the " + side + " image of frame " + fs::path(name).stem().string());
    return file.string();
  }

  std::string groundTruth(const char* kind, const std::string& name) const {
    if (!fs::is_directory(folder / kind)) return "";
    const fs::path file = folder / kind / name;
    requireFile(file, "the ground truth of frame " + fs::path(name).stem().string());
    return file.string();
  }
};

/// The frames of which `open` finds all files.
std::vector<KittiFrame> openFrames(const fs::path& folder, const std::set<std::string>& names,
                                   const std::function<KittiFrame(const std::string&)>& open,
                                   std::vector<IncompleteKittiFrame>* incomplete) {
  std::vector<KittiFrame> frames;
  for (const std::string& name : names) {
    try {
      frames.push_back(open(name));
    } catch (const std::runtime_error& error) {
      if (incomplete == nullptr) throw;
      incomplete->push_back({fs::path(name).stem().string(), error.what()});
    }
  }
  if (frames.empty()) fail(folder, "no frame is complete: ", incomplete->front().problem);
  return frames;
}

/// Names of the benchmark's frames in folders, as far as these exist.
std::set<std::string> frameNames(const std::vector<fs::path>& folders) {
  std::set<std::string> names;
  for (const fs::path& folder : folders) {
    const std::vector<std::string> files = listFiles(folder, "_10.png");
    names.insert(files.begin(), files.end());
  }
  return names;
}

std::vector<KittiFrame> openBenchmark(const fs::path& folder, const CameraNames& camera, double rate,
                                      std::vector<IncompleteKittiFrame>* incomplete) {
  const BenchmarkFiles files{folder, camera};
  const std::set<std::string> names = frameNames({files.images(camera.left), files.images(camera.right)});
  const auto open = [&](const std::string& name) {
    KittiFrame frame = files.open(name);
    const auto index = std::distance(names.begin(), names.find(name));
    frame.left_stamp = frame.right_stamp =
        EPOCH + std::llround(static_cast<double>(index) / rate * static_cast<double>(SECOND));
    return frame;
  };
  return openFrames(folder, names, open, incomplete);
}

}  // namespace

KittiDataset openKittiDataset(const std::string& folder, KittiCameras cameras, double benchmark_rate,
                              std::vector<IncompleteKittiFrame>* incomplete) {
  requireArgument(benchmark_rate >= 1e-3 && benchmark_rate <= 1e6, "benchmark_rate", benchmark_rate,
                  "0.001 ... 1000000");
  const fs::path path(folder);
  if (!fs::is_directory(path)) fail(path, "no such folder");
  const CameraNames camera = cameras == KittiCameras::GRAY ? CameraNames{"0", "1"} : CameraNames{"2", "3"};
  const auto has = [&](const char* name) { return fs::is_directory(path / name); };
  if (has("image_00") || has("image_02")) return {KittiLayout::RAW, openRaw(path, camera)};
  if (!has("image_0") && !has("image_2")) {
    fail(path,
         "expected an odometry sequence (image_0, image_1, calib.txt, times.txt), a raw drive (image_00, "
         "image_01) or a "
         "stereo benchmark folder (image_0, image_1, calib)");
  }
  if (has("calib") || has("disp_noc") || has("disp_occ")) {
    return {KittiLayout::STEREO_BENCHMARK, openBenchmark(path, camera, benchmark_rate, incomplete)};
  }
  return {KittiLayout::ODOMETRY, openOdometry(path, camera)};
}

std::vector<KittiFrame> listGroundTruth(const std::string& folder,
                                        std::vector<IncompleteKittiFrame>* incomplete) {
  const BenchmarkFiles files{fs::path(folder), {}};
  std::vector<fs::path> folders;
  for (const char* kind : {"disp_noc", "disp_occ"}) {
    if (fs::is_directory(files.folder / kind)) folders.push_back(files.folder / kind);
  }
  if (folders.empty()) fail(files.folder, "no ground truth, expected a folder disp_noc or disp_occ");
  const auto open = [&](const std::string& name) { return files.openGroundTruth(name); };
  return openFrames(files.folder, frameNames(folders), open, incomplete);
}

}  // namespace disparity_refinement
