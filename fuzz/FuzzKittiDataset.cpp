// Folders of KITTI's three layouts: times, dates, calibrations and names of files with any content.

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "Input.hpp"
#include "KittiFixture.hpp"
#include "disparity_refinement/evaluation/KittiDataset.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

namespace fs = std::filesystem;

// The three layouts with gray cameras; the images are never read, and empty.
struct Folders {
  Folders() : odometry(root / "odometry"), drive(root / "day/drive"), benchmark(root / "training") {
    for (const std::string camera : {"0", "1"}) {
      for (int i = 0; i < 3; ++i) {
        writeText(odometry / ("image_" + camera) / numbered(i, 6, ".png"), "");
        writeText(drive / ("image_0" + camera) / "data" / numbered(i, 10, ".png"), "");
        writeText(benchmark / ("image_" + camera) / numbered(i, 6, "_10.png"), "");
      }
    }
    writeText(root / "day/calib_cam_to_cam.txt", calibration("P_rect_0"));
    for (int i = 0; i < 3; ++i) {
      writeText(benchmark / "calib" / numbered(i, 6, ".txt"), calibration("P"));
      writeText(benchmark / "disp_noc" / numbered(i, 6, "_10.png"), "");
    }
  }

  TemporaryFolder root;
  fs::path odometry, drive, benchmark;
};

// A file that is there for one input.
class ExtraFile {
 public:
  ExtraFile(const fs::path& folder, const std::string& name) : path_(folder / name) {
    std::error_code error;
    if (name.empty() || name.find('/') != std::string::npos || name.find('\0') != std::string::npos) return;
    if (fs::exists(path_, error) || error) return;
    is_made_ = static_cast<bool>(std::ofstream(path_));
  }
  ~ExtraFile() {
    if (is_made_) fs::remove(path_);
  }
  ExtraFile(const ExtraFile&) = delete;
  ExtraFile& operator=(const ExtraFile&) = delete;

 private:
  fs::path path_;
  bool is_made_ = false;
};

std::string secondsOf(Input& input) {
  if (input.oneIn(6)) return input.text(12);
  return input.oneIn(3) ? std::to_string(input.anyNumber<double>())
                        : std::to_string(input.number(-5, 2000) / 10.0);
}

std::string dateOf(Input& input) {
  if (input.oneIn(6)) return input.text(32);
  char text[80];
  std::snprintf(text, sizeof text, "%04d-%02d-%02d %02d:%02d:%02d",
                input.oneIn(3) ? input.number(-999, 9999) : 2011, input.oneIn(6) ? input.number(-9, 99) : 9,
                input.oneIn(6) ? input.number(-9, 99) : 26, input.oneIn(6) ? input.number(-9, 99) : 13,
                input.oneIn(6) ? input.number(-9, 99) : 2, input.number(0, 61));
  return text + (input.oneIn(3) ? input.text(12) : "." + std::to_string(input.number(0, 999999999)));
}

std::string linesOf(Input& input, std::string (*line)(Input&)) {
  if (input.oneIn(8)) return input.bytes().ConsumeRemainingBytesAsString();
  std::string text;
  for (int i = input.oneIn(4) ? input.number(0, 5) : 3; i > 0; --i)
    text += line(input) + input.oneOf<std::string>({"\n", "\n", "\r\n", ""});
  return text;
}

std::string nameOf(Input& input) {
  if (input.oneIn(2)) return input.text(20) + input.oneOf<std::string>({".png", "_10.png", ""});
  return input.oneOf<std::string>({".png", "_10.png", "3.png", "99999999999999999999.png", "2147483648.png",
                                   "000003_10.png", "-1.png", "000001.PNG"});
}

}  // namespace

void test(Input& input) {
  static const Folders folders;
  const int layout = input.number(0, 2);
  const fs::path& folder = layout == 0 ? folders.odometry : layout == 1 ? folders.drive : folders.benchmark;
  std::vector<fs::path> images = {folder / "image_0", folder / "image_1"};
  if (layout == 0) {
    writeText(folder / "calib.txt", input.oneIn(6) ? input.text(40) : calibration("P"));
    writeText(folder / "times.txt", linesOf(input, secondsOf));
  } else if (layout == 1) {
    images = {folder / "image_00/data", folder / "image_01/data"};
    writeText(folder / "image_00/timestamps.txt", linesOf(input, dateOf));
    writeText(folder / "image_01/timestamps.txt", linesOf(input, dateOf));
  } else {
    images.push_back(folder / "disp_noc");
    writeText(folder / "calib/000001.txt", input.oneIn(6) ? input.text(40) : calibration("P"));
  }
  // Often in all folders, sometimes in one alone.
  const std::string name = input.oneIn(3) ? nameOf(input) : "";
  std::vector<std::unique_ptr<ExtraFile>> extra;
  for (const fs::path& path : images) {
    if (!input.oneIn(4)) extra.push_back(std::make_unique<ExtraFile>(path, name));
  }

  std::vector<IncompleteKittiFrame> incomplete;
  std::vector<IncompleteKittiFrame>* const left_out = input.yes() ? &incomplete : nullptr;
  const double rate = input.oneIn(4) ? input.anyNumber<double>() : 10.0;
  KittiDataset dataset;
  bool is_rate_good = true;
  const bool is_read = succeeds<std::runtime_error>(
      [&] {
        is_rate_good =
            succeeds([&] { dataset = openKittiDataset(folder.string(), KittiCameras::GRAY, rate, left_out); },
                     "benchmark_rate");
      },
      folders.root.string());
  if (is_read && is_rate_good) {
    require(!dataset.frames.empty() && static_cast<int>(dataset.layout) == layout,
            "there are frames of the layout");
    std::int64_t before = 0;
    for (const KittiFrame& frame : dataset.frames) {
      require(frame.left_stamp > before && frame.right_stamp > 0, "times rise");
      // What a ros::Time holds.
      require(std::max(frame.left_stamp, frame.right_stamp) < (std::int64_t{1} << 32) * 1000000000,
              "times end in 2106");
      before = frame.left_stamp;
    }
  }
  incomplete.clear();
  succeeds<std::runtime_error>([&] { listGroundTruth(folder.string(), left_out); }, folders.root.string());
}

}  // namespace fuzz
}  // namespace disparity_refinement
