#pragma once

#include <rosbag/bag.h>

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "disparity_refinement/evaluation/KittiFiles.hpp"

namespace disparity_refinement {

/// A rectified stereo pair as a bag holds it.
struct BagFrame {
  cv::Mat left, right;  ///< Both CV_8UC1 or both CV_8UC3 (BGR), of the same size.
  cv::Mat disparity;    ///< Ground truth of the left image [px], CV_32FC1, 0 where unknown; empty: none.
  ProjectionMatrix left_projection{}, right_projection{};
  std::int64_t left_stamp = 0, right_stamp = 0;  ///< [ns since 1970], not before those of the frame before.
};

/// Writes stereo frames to a bag, under the names of image_proc:
///
///   NAMESPACE/{left,right}/image_rect       sensor_msgs/Image, mono8; image_rect_color, bgr8, for colour
///   NAMESPACE/{left,right}/camera_info      sensor_msgs/CameraInfo of a rectified camera: P, K = its left
///   3x3 part, R = 1, D = 0 NAMESPACE/ground_truth/disparity        stereo_msgs/DisparityImage
///
/// All of them are in the frame of the left camera, to which P refers.
///
/// The bag is written to PATH.active and gets its name in finish(): whatever happens before, an error, Ctrl-C
/// or a full disk, leaves no half-written bag.
class BagWriter {
 public:
  /// Throws std::runtime_error if the bag exists and must not be overwritten, or cannot be created,
  /// std::invalid_argument if the namespace is no ROS name.
  BagWriter(const std::string& path, const std::string& name_space, bool overwrite);
  ~BagWriter();
  BagWriter(const BagWriter&) = delete;
  BagWriter& operator=(const BagWriter&) = delete;

  /// Throws std::runtime_error if the bag cannot be written or the process got SIGINT, SIGTERM or SIGHUP.
  void write(const BagFrame& frame);

  /// Completes the bag. Throws as write().
  void finish();

 private:
  class SignalGuard;

  std::string path_, active_path_, name_space_;
  std::unique_ptr<SignalGuard> signal_guard_;
  std::unique_ptr<rosbag::Bag> bag_;
  std::uint32_t seq_ = 0;
};

}  // namespace disparity_refinement
