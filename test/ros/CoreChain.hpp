#pragma once

#include <stereo_msgs/DisparityImage.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <thread>
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

/// A camera whose frames are known by their content. A frame has an index, of which follow its stamp and one
/// of CONTENTS pairs, and with that what the chain has to make of it.
class KnownCamera {
 public:
  static constexpr int CONTENTS = 6;
  using Disparity = stereo_msgs::DisparityImage;

  KnownCamera(ros::NodeHandle& nh, const CoreParameters& parameters) : camera(nh) {
    CoreParameters paper = parameters;
    paper.refinement.mode = RefinementMode::PAPER;
    for (int i = 0; i < CONTENTS; ++i) {
      frames_.push_back(camera.street().render(i));
      refined_.push_back(runCore(make(i), parameters).refined);
      without_image_.push_back(runCore(make(i), paper).refined);
    }
  }

  /// An earlier index than 0 has the content of 0, as StereoCamera's.
  static int content(int index) { return std::max(0, index) % CONTENTS; }

  StereoMessages make(int index) const {
    const StreetFrame& frame = frames_[static_cast<std::size_t>(content(index))];
    return camera.make(frame.left, frame.right, StereoCamera::stamp(index));
  }

  void publish(int index) { camera.publish(make(index)); }

  /// Publishes the next frame of the process: no two cameras of it publish the same.
  void publishNext() { publish(index()++); }
  /// Stamp of the newest frame so published.
  ros::Time lastStamp() const { return StereoCamera::stamp(index() - 1); }

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

  /// Maps that are not those of the pair with their stamp.
  int countWrongPairs(const Listener<Disparity>& refined) const {
    int wrong = 0;
    for (const auto& message : refined.all()) {
      const double index = (message->header.stamp - StereoCamera::stamp(0)).toSec() / 0.1;
      if (!isOfContent(*message, content(static_cast<int>(std::lround(index))))) ++wrong;
    }
    return wrong;
  }

  StereoCamera camera;

 private:
  static std::atomic<int>& index() {
    static std::atomic<int> index{0};
    return index;
  }

  std::vector<StreetFrame> frames_;
  std::vector<cv::Mat> refined_, without_image_;  ///< What the core makes of frames_.
};

/// Publishes a frame every 50 ms until it is destroyed.
class Driver {
 public:
  explicit Driver(KnownCamera& camera) : camera_(camera), thread_([this] { run(); }) {}

  ~Driver() {
    stop_ = true;
    thread_.join();
  }

  Driver(const Driver&) = delete;
  Driver& operator=(const Driver&) = delete;

 private:
  void run() {
    while (!stop_) {
      camera_.publishNext();
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  }

  KnownCamera& camera_;
  std::atomic<bool> stop_{false};
  std::thread thread_;  // last: it uses the others
};

}  // namespace disparity_refinement
