#pragma once

#include <stereo_msgs/DisparityImage.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "ChainClient.hpp"
#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

/// What the chain has to give: the same pair through the core.
namespace disparity_refinement {

struct CoreParameters {
  MatchingParameters matching;
  SegmentationParameters segmentation;
  RefinementParameters refinement;
};

struct CoreResult {
  DisparityRange range;
  cv::Mat disparity, labels, refined;
  int segments = 0;
  std::vector<SegmentPlane> planes, fitted_planes;
};

/// For a pair of mono8 images.
inline CoreResult runCore(const StereoMessages& messages, const CoreParameters& parameters) {
  const cv::Mat left = imageView(*messages.left, "mono8", "left");
  const cv::Mat right = imageView(*messages.right, "mono8", "right");

  CoreResult result;
  StereoMatcher matcher(parameters.matching);
  matcher.compute(left, right, result.disparity);
  result.range = matcher.range();
  Segmentation segmentation;
  result.segments = segmentation.compute(left, parameters.segmentation, result.labels);
  DisparityRefinement refinement;
  const double f_times_t = static_cast<double>(static_cast<float>(messages.left_info->P[0])) *
                           static_cast<float>(-messages.right_info->P[3] / messages.left_info->P[0]);
  refinement.refine(result.disparity, result.labels, left, result.range, f_times_t, parameters.refinement,
                    result.refined);
  result.planes = refinement.planes();
  result.fitted_planes = refinement.fittedPlanes();
  return result;
}

inline bool sameBits(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && a.isContinuous() && b.isContinuous() &&
         std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

/// A chain in a namespace, with a camera in front of it whose frames are known by their content. A frame has
/// an index, of which follow its stamp and one of CONTENTS pairs, and with that what the chain has to make of
/// it.
class CheckedChain {
 public:
  static constexpr int CONTENTS = 6;
  using Disparity = stereo_msgs::DisparityImage;

  CheckedChain(const std::string& name, const CoreParameters& parameters) : nh("/" + name), camera(nh) {
    CoreParameters paper = parameters;
    paper.refinement.mode = RefinementMode::PAPER;
    for (int i = 0; i < CONTENTS; ++i) {
      frames_.push_back(camera.street().render(i));
      refined_.push_back(runCore(make(i), parameters).refined);
      without_image_.push_back(runCore(make(i), paper).refined);
    }
  }

  bool connect() { return camera.waitForChain(refined); }

  /// An earlier index than 0 has the content of 0, as StereoCamera's.
  static int content(int index) { return std::max(0, index) % CONTENTS; }

  StereoMessages make(int index) const {
    const StreetFrame& frame = frames_[static_cast<std::size_t>(content(index))];
    return camera.make(frame.left, frame.right, StereoCamera::stamp(index));
  }

  /// The same with the right camera's stamps later by `seconds`.
  StereoMessages makeApart(int index, double seconds) const {
    StereoMessages messages = make(index);
    messages.right->header.stamp += ros::Duration(seconds);
    messages.right_info->header.stamp = messages.right->header.stamp;
    return messages;
  }

  void publish(int index) { camera.publish(make(index)); }

  /// Whether the refined map of a frame arrives.
  bool arrives(int index, double timeout = TIMEOUT) {
    return refined.wait(StereoCamera::stamp(index), timeout) != nullptr;
  }

  /// Whether this map is what the core makes of the pair of content `i`. When the left image of a frame is
  /// late, the refinement beyond the paper does without it.
  bool isOfContent(const Disparity& message, int i) const {
    const cv::Mat map = imageView(message.image, "32FC1", "refined");
    const auto index = static_cast<std::size_t>(i);
    return sameBits(map, refined_[index]) || sameBits(map, without_image_[index]);
  }

  /// Whether it is of one pair at all, and not of images or segments of different frames.
  bool isOfOnePair(const Disparity& message) const {
    for (int i = 0; i < CONTENTS; ++i) {
      if (isOfContent(message, i)) return true;
    }
    return false;
  }

  /// Maps so far that are not those of the pair with their stamp.
  int countWrongPairs() {
    int wrong = 0;
    for (const auto& message : refined.all()) {
      const double index = (message->header.stamp - StereoCamera::stamp(0)).toSec() / 0.1;
      if (!isOfContent(*message, content(static_cast<int>(std::lround(index))))) ++wrong;
    }
    return wrong;
  }

  ros::NodeHandle nh;
  StereoCamera camera;
  Listener<Disparity> refined{nh, "disparity_refined"};

 private:
  std::vector<StreetFrame> frames_;
  std::vector<cv::Mat> refined_, without_image_;  ///< What the core makes of frames_.
};

}  // namespace disparity_refinement
