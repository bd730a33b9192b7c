#include "KittiToBag.hpp"

#include <algorithm>

#include "BagWriter.hpp"
#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

BagFrame readFrame(const KittiFrame& files, const KittiToBagOptions& options) {
  const bool is_gray = options.cameras == KittiCameras::GRAY;
  const auto read = is_gray ? readGrayImage : readColorImage;
  BagFrame frame;
  frame.left = read(files.left);
  frame.right = read(files.right);
  requireSizeOfLeftImage(files.right, frame.right, frame.left.size());
  const std::string& ground_truth = files.disp_noc.empty() ? files.disp_occ : files.disp_noc;
  if (is_gray && !ground_truth.empty()) {
    frame.disparity = readDisparityPng(ground_truth);
    requireSizeOfLeftImage(ground_truth, frame.disparity, frame.left.size());
  }
  frame.left_projection = files.left_projection;
  frame.right_projection = files.right_projection;
  frame.left_stamp = files.left_stamp;
  frame.right_stamp = options.original_stamps ? files.right_stamp : files.left_stamp;
  return frame;
}

}  // namespace

int convertKitti(const KittiToBagOptions& options, const std::function<void(int, int)>& progress) {
  const std::vector<KittiFrame> files = openKittiDataset(options.input, options.cameras, options.rate).frames;
  const int available = static_cast<int>(files.size());
  requireArgument(options.start >= 0 && options.start < available, "start", options.start,
                  "0 ... " + std::to_string(available - 1));
  requireArgument(options.frames >= 0, "frames", options.frames, "at least 0");
  const int rest = available - options.start;
  const int count = options.frames == 0 ? rest : std::min(options.frames, rest);

  BagWriter bag(options.output, options.name_space, options.overwrite);
  for (int i = 0; i < count; ++i) {
    bag.write(readFrame(files[options.start + i], options));
    progress(i + 1, count);
  }
  bag.finish();
  return count;
}

}  // namespace disparity_refinement
