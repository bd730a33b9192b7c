#pragma once

#include <functional>
#include <string>

#include "disparity_refinement/evaluation/KittiDataset.hpp"

namespace disparity_refinement {

struct KittiToBagOptions {
  std::string input;   ///< Folder of the dataset, see KittiDataset.
  std::string output;  ///< The bag.
  KittiCameras cameras = KittiCameras::GRAY;
  std::string name_space = "stereo";
  int start = 0;       ///< First frame taken, >= 0.
  int frames = 0;      ///< Number of frames taken, fewer if the dataset ends; 0: all.
  double rate = 10.0;  ///< Frames per second of a stereo benchmark folder, which has no times of its own.
  /// Gives the right image its own time. By default it has the left one's, as a synchronized stereo camera
  /// would give it.
  bool original_stamps = false;
  bool overwrite = false;
};

/// Converts a KITTI dataset to a bag, see BagWriter. The ground truth of a benchmark folder, disp_noc before
/// disp_occ, goes with the gray images, for which it was made.
///
/// @param progress  Called after every frame with the numbers of frames done and to do.
/// @return          The number of frames.
/// Throws std::runtime_error that names the file, or std::invalid_argument that names the option, and leaves
/// no bag.
int convertKitti(
    const KittiToBagOptions& options, const std::function<void(int, int)>& progress = [](int, int) {});

}  // namespace disparity_refinement
