#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "disparity_refinement/evaluation/KittiFiles.hpp"

namespace disparity_refinement {

/// The three ways in which KITTI lays out rectified stereo images.
enum class KittiLayout {
  ODOMETRY,  ///< image_0 ... image_3, calib.txt, times.txt
  RAW,  ///< A "sync" drive: image_00/data and image_00/timestamps.txt ... image_03, calib_cam_to_cam.txt in
        ///< the folder or in the one above it
  STEREO_BENCHMARK  ///< image_0 ... image_3 with files NNNNNN_10.png, calib/NNNNNN.txt, disp_noc and disp_occ
                    ///< where known
};

enum class KittiCameras {
  GRAY,  ///< Cameras 0 and 1.
  COLOR  ///< Cameras 2 and 3.
};

/// Files, times and projection of one stereo pair.
struct KittiFrame {
  std::string name;                ///< File name without its extension.
  std::string left, right;         ///< Image files.
  std::string disp_noc, disp_occ;  ///< Ground truth of the gray left image; empty where the dataset has none.
  std::int64_t left_stamp = 0;     ///< [ns since 1970-01-01 UTC], > 0, before 2106
  std::int64_t right_stamp = 0;    ///< [ns since 1970-01-01 UTC], > 0, before 2106
  ProjectionMatrix left_projection{}, right_projection{};
};

/// A frame that lacks a file.
struct IncompleteKittiFrame {
  std::string name;
  std::string problem;  ///< Names the file.
};

struct KittiDataset {
  KittiLayout layout = KittiLayout::ODOMETRY;
  std::vector<KittiFrame> frames;  ///< At least one, by rising time.
};

/// Recognises the layout of a folder and lists its frames; the images are not read.
///
/// The times of an odometry sequence start at 0 and the benchmark has none. Both are set at the beginning of
/// 2011-09-26 UTC, the day of KITTI's first drive, since ROS takes a time of 0 for "unknown".
///
/// @param benchmark_rate  Frames of a STEREO_BENCHMARK per second, 0.001...1000000.
/// @param incomplete  If given, the frames of a STEREO_BENCHMARK that lack a file are told here and left out;
///                    without it the first one throws.
/// Throws std::runtime_error that names the file and what was expected if one is missing or does not fit to
/// the others, std::invalid_argument for a bad rate.
KittiDataset openKittiDataset(const std::string& folder, KittiCameras cameras = KittiCameras::GRAY,
                              double benchmark_rate = 10.0,
                              std::vector<IncompleteKittiFrame>* incomplete = nullptr);

/// Lists the ground truth of a stereo benchmark folder alone, for maps that were made elsewhere: the frames
/// of disp_noc and disp_occ, without images and projections. `incomplete` as above: frames that are in one of
/// them only. Throws std::runtime_error that names the folder if there is neither.
std::vector<KittiFrame> listGroundTruth(const std::string& folder,
                                        std::vector<IncompleteKittiFrame>* incomplete = nullptr);

}  // namespace disparity_refinement
