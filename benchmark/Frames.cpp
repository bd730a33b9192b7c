#include "Frames.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>
#include <map>

#include "disparity_refinement/StereoGeometry.hpp"
#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/evaluation/KittiDataset.hpp"
#include "disparity_refinement/evaluation/KittiFiles.hpp"
#include "disparity_refinement/evaluation/SyntheticStreet.hpp"
#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {
namespace {

struct Street {
  const char* name;
  StreetParameters parameters;
};

StreetParameters street(int width, int height, double focal_length) {
  StreetParameters parameters;
  parameters.width = width;
  parameters.height = height;
  parameters.focal_length = focal_length;
  parameters.baseline = 0.54;
  return parameters;
}

// The second one has KITTI's camera.
const std::array<Street, 4> STREETS = {{{"640x480", street(640, 480, 400.0)},
                                        {"1242x375", street(1242, 375, 721.0)},
                                        {"1920x1200", street(1920, 1200, 1200.0)},
                                        {"4096x3000", street(4096, 3000, 2560.0)}}};

constexpr const char* KITTI = "KITTI";
constexpr std::size_t KITTI_FRAMES = 4;

const char* kittiFolder() { return std::getenv("DISPARITY_REFINEMENT_KITTI"); }

Frame makeFrame(const cv::Mat& left, const cv::Mat& right, double focal_length_times_baseline) {
  Frame frame;
  frame.left = left;
  frame.right = right;
  frame.focal_length_times_baseline = focal_length_times_baseline;
  MatchingParameters matching;
  matching.disparity_range = DISPARITIES;
  StereoMatcher matcher(matching);
  matcher.compute(left, right, frame.disparity);
  frame.range = matcher.range();
  Segmentation().compute(left, {}, frame.labels);
  return frame;
}

FrameSet streetSet(const StreetParameters& parameters) {
  const StreetFrame frame = SyntheticStreet(parameters).render(0);
  return {{makeFrame(frame.left, frame.right, parameters.focal_length * parameters.baseline)}};
}

// Frames from all over the folder.
FrameSet kittiSet(const std::string& folder) {
  const std::vector<KittiFrame> all = openKittiDataset(folder).frames;
  const std::size_t count = std::min(KITTI_FRAMES, all.size());
  FrameSet set;
  for (std::size_t i = 0; i < count; ++i) {
    const KittiFrame& frame = all[i * all.size() / count];
    const StereoGeometry geometry = stereoGeometry(frame.left_projection, frame.right_projection);
    set.frames.push_back(makeFrame(readGrayImage(frame.left), readGrayImage(frame.right),
                                   geometry.focal_length * geometry.baseline));
  }
  return set;
}

FrameSet makeSet(const std::string& name) {
  for (const Street& street : STREETS) {
    if (name == street.name) return streetSet(street.parameters);
  }
  requireArgument(name == KITTI && kittiFolder() != nullptr, "frame set", name, "one of frameSetNames()");
  return kittiSet(kittiFolder());
}

}  // namespace

double FrameSet::megapixels() const {
  double pixels = 0.0;
  for (const Frame& frame : frames) pixels += static_cast<double>(frame.left.total());
  return pixels * 1e-6;
}

std::vector<std::string> frameSetNames() {
  std::vector<std::string> names;
  for (const Street& street : STREETS) names.emplace_back(street.name);
  if (kittiFolder() != nullptr) names.emplace_back(KITTI);
  return names;
}

const FrameSet& frameSet(const std::string& name) {
  static std::map<std::string, FrameSet> sets;
  const auto found = sets.find(name);
  return found != sets.end() ? found->second : sets.emplace(name, makeSet(name)).first->second;
}

}  // namespace disparity_refinement
