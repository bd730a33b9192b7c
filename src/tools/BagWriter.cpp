#include "BagWriter.hpp"

#include <cv_bridge/cv_bridge.h>
#include <ros/names.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/distortion_models.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <stdexcept>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/ros/StereoGeometry.hpp"

namespace disparity_refinement {
namespace {

namespace fs = std::filesystem;

constexpr const char* FRAME_ID = "stereo_left";

// A signal handler reaches nothing but a global.
volatile std::sig_atomic_t is_interrupted = 0;

extern "C" void interrupt(int /*signal*/) { is_interrupted = 1; }

/// "stereo", "/stereo" and "/stereo/" are the same.
std::string absoluteName(const std::string& name_space) {
  const std::string name = ros::names::clean("/" + name_space);
  std::string error;
  if (name.size() < 2 || !ros::names::validate(name, error)) {
    throw std::invalid_argument("namespace is \"" + name_space +
                                "\", expected a ROS name: letters, digits, _ and /");
  }
  return name;
}

sensor_msgs::CameraInfo cameraInfo(const std_msgs::Header& header, const cv::Size& size,
                                   const ProjectionMatrix& projection) {
  sensor_msgs::CameraInfo info;
  info.header = header;
  info.width = static_cast<std::uint32_t>(size.width);
  info.height = static_cast<std::uint32_t>(size.height);
  info.distortion_model = sensor_msgs::distortion_models::PLUMB_BOB;
  info.D.assign(5, 0.0);
  std::copy(projection.begin(), projection.end(), info.P.begin());
  for (std::size_t row = 0; row < 3; ++row) {
    std::copy_n(projection.begin() + 4 * row, 3, info.K.begin() + 3 * row);
    info.R[4 * row] = 1.0;
  }
  return info;
}

stereo_msgs::DisparityImagePtr groundTruth(const std_msgs::Header& header, const cv::Mat& disparity,
                                           const StereoGeometry& geometry) {
  double largest = 0.0;
  cv::minMaxIdx(disparity, nullptr, &largest);
  const DisparityRange range{0.0F, static_cast<float>(std::floor(largest)) + 1.0F};
  const stereo_msgs::DisparityImagePtr message =
      makeDisparityImage(header, disparity.size(), geometry, range, cv::Rect({0, 0}, disparity.size()));
  message->delta_d = 1.0F / 256.0F;  // the step of KITTI's files
  cv::Mat map = imageView(message->image, sensor_msgs::image_encodings::TYPE_32FC1, "ground truth");
  disparity.copyTo(map);
  map.setTo(range.invalid(), disparity <= 0.0F);
  keepOneInvalid(map, range);
  return message;
}

}  // namespace

/// Takes note of the signals that end a process, as long as it lives.
class BagWriter::SignalGuard {
 public:
  SignalGuard() {
    is_interrupted = 0;
    struct sigaction action {};
    action.sa_handler = interrupt;
    for (std::size_t i = 0; i < SIGNALS.size(); ++i) sigaction(SIGNALS[i], &action, &former_[i]);
  }
  ~SignalGuard() {
    for (std::size_t i = 0; i < SIGNALS.size(); ++i) sigaction(SIGNALS[i], &former_[i], nullptr);
  }
  SignalGuard(const SignalGuard&) = delete;
  SignalGuard& operator=(const SignalGuard&) = delete;

  static void check() {
    if (is_interrupted != 0) throw std::runtime_error("interrupted");
  }

 private:
  static constexpr std::array<int, 3> SIGNALS = {SIGINT, SIGTERM, SIGHUP};
  std::array<struct sigaction, SIGNALS.size()> former_{};
};

BagWriter::BagWriter(const std::string& path, const std::string& name_space, bool overwrite)
    : path_(path), active_path_(path + ".active"), name_space_(absoluteName(name_space)) {
  if (fs::exists(path) && !fs::is_regular_file(path)) {
    throw std::runtime_error(path + ": is no file, expected the name of a bag");
  }
  if (fs::exists(path) && !overwrite) {
    throw std::runtime_error(path + ": exists already, expected the name of a new bag or --force");
  }
  signal_guard_ = std::make_unique<SignalGuard>();
  bag_ = std::make_unique<rosbag::Bag>();
  try {
    bag_->open(active_path_, rosbag::bagmode::Write);
  } catch (const rosbag::BagException& error) {
    throw std::runtime_error(path + ": cannot be created (" + error.what() + ")");
  }
}

BagWriter::~BagWriter() {
  if (bag_ == nullptr) return;
  try {
    bag_->close();
  } catch (const std::exception&) {
    // Its destructor would try once more, and end the program.
    static_cast<void>(bag_.release());
  }
  std::error_code ignored;
  fs::remove(active_path_, ignored);
}

void BagWriter::write(const BagFrame& frame) {
  SignalGuard::check();
  std_msgs::Header left_header;
  left_header.seq = seq_++;
  left_header.stamp.fromNSec(static_cast<std::uint64_t>(frame.left_stamp));
  left_header.frame_id = FRAME_ID;
  std_msgs::Header right_header = left_header;
  right_header.stamp.fromNSec(static_cast<std::uint64_t>(frame.right_stamp));

  const sensor_msgs::CameraInfo left_info = cameraInfo(left_header, frame.left.size(), frame.left_projection);
  const sensor_msgs::CameraInfo right_info =
      cameraInfo(right_header, frame.right.size(), frame.right_projection);
  const auto write_camera = [&](const std::string& side, const cv::Mat& image,
                                const sensor_msgs::CameraInfo& info) {
    const bool is_gray = image.channels() == 1;
    const std::string& encoding =
        is_gray ? sensor_msgs::image_encodings::MONO8 : sensor_msgs::image_encodings::BGR8;
    const std::string topic = name_space_ + "/" + side + "/";
    bag_->write(topic + "camera_info", info.header.stamp, info);
    bag_->write(topic + (is_gray ? "image_rect" : "image_rect_color"), info.header.stamp,
                cv_bridge::CvImage(info.header, encoding, image).toImageMsg());
  };
  const auto write_left = [&] {
    write_camera("left", frame.left, left_info);
    if (!frame.disparity.empty()) {
      bag_->write(name_space_ + "/ground_truth/disparity", left_header.stamp,
                  groundTruth(left_header, frame.disparity, stereoGeometry(left_info, right_info)));
    }
  };
  try {
    if (frame.right_stamp < frame.left_stamp) {
      write_camera("right", frame.right, right_info);
      write_left();
    } else {
      write_left();
      write_camera("right", frame.right, right_info);
    }
  } catch (const rosbag::BagException& error) {
    throw std::runtime_error(path_ + ": cannot be written (" + error.what() + ")");
  }
}

void BagWriter::finish() {
  SignalGuard::check();
  try {
    bag_->close();
    fs::rename(active_path_, path_);
  } catch (const std::exception& error) {
    throw std::runtime_error(path_ + ": cannot be written (" + error.what() + ")");
  }
  bag_.reset();
}

}  // namespace disparity_refinement
