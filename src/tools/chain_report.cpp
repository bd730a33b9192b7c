// Watches the refinement chain while a bag plays and reports what came out: frames, rate, latency, density,
// and the error against the ground truth if the bag holds one. Started by kitti.launch with report:=FOLDER.

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <stereo_msgs/DisparityImage.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "Format.hpp"
#include "disparity_refinement/evaluation/KittiMetric.hpp"
#include "disparity_refinement/ros/Messages.hpp"
#include "disparity_refinement/visualization/RefinementPicture.hpp"

namespace disparity_refinement {
namespace {

using Disparity = stereo_msgs::DisparityImage;
using Image = sensor_msgs::Image;

/// Figures of one kind of disparity map, raw or refined.
class MapFigures {
 public:
  void add(const Disparity& message, const std::string& topic, const cv::Mat& truth) {
    const DisparityRange range = disparityRange(message, topic);
    const cv::Mat map = imageView(message.image, sensor_msgs::image_encodings::TYPE_32FC1, topic);
    density_sum_ +=
        static_cast<double>(cv::countNonZero(map >= range.min)) / static_cast<double>(map.total());
    ++maps_;
    if (!truth.empty()) scores_.add(scoreDisparity(map, range, truth));
  }

  std::string row(const std::string& name) const {
    std::string text = format("%-20s %8.2f %%", name.c_str(), maps_ > 0 ? 100.0 * density_sum_ / maps_ : 0.0);
    if (scores_.count() > 0) {
      const KittiScore score = scores_.mean();
      text += format("  %10.2f %%  %10.2f %%  %10.3f px", 100.0 * score.est.outliers[2],
                     100.0 * score.all.outliers[2], score.all.end_point_error);
    }
    return text + "\n";
  }

  bool hasScores() const { return scores_.count() > 0; }

 private:
  double density_sum_ = 0.0;
  int maps_ = 0;
  KittiScoreMean scores_;
};

class ChainReport {
 public:
  ChainReport() : nh_(), private_nh_("~") {
    folder_ = private_nh_.param<std::string>("folder", "");
    if (folder_.empty()) throw std::invalid_argument("~folder is empty, expected a folder for the report");
    if (mkdir(folder_.c_str(), 0777) != 0 && errno != EEXIST) {
      throw std::invalid_argument("~folder " + folder_ + " cannot be made");
    }
    idle_timeout_ = private_nh_.param("idle_timeout", 5.0);
    first_timeout_ = private_nh_.param("first_timeout", 60.0);
    picture_interval_ = std::max(1, private_nh_.param("picture_interval", 10));
    constexpr std::uint32_t QUEUE = 1000;
    image_ = nh_.subscribe("left/image_rect", QUEUE, &ChainReport::onImage, this);
    truth_ = nh_.subscribe("ground_truth/disparity", QUEUE, &ChainReport::onTruth, this);
    labels_ = nh_.subscribe("labels", QUEUE, &ChainReport::onLabels, this);
    raw_ = nh_.subscribe("disparity", QUEUE, &ChainReport::onRaw, this);
    refined_ = nh_.subscribe("disparity_refined", QUEUE, &ChainReport::onRefined, this);
  }

  /// Returns when the chain has been silent for a while.
  void watch() {
    const ros::WallTime start = ros::WallTime::now();
    while (ros::ok()) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
      const ros::WallTime now = ros::WallTime::now();
      if (frames_in_ == 0 && (now - start).toSec() > first_timeout_) {
        throw std::runtime_error(image_.getTopic() + ": no image within " + std::to_string(first_timeout_) +
                                 " s");
      }
      if (frames_in_ > 0 && (now - last_message_).toSec() > idle_timeout_) return;
    }
  }

  void write() const {
    std::string text;
    text += format("%-20s %8d\n", "frames in", frames_in_);
    text += format("%-20s %8d\n", "frames refined", static_cast<int>(latencies_.size()));
    if (static_cast<int>(latencies_.size()) < frames_in_) {
      text +=
          "Some frames were not refined: the bag is played faster than this machine can follow (lower "
          "rate:=), "
          "or the log says why.\n";
    }
    if (latencies_.size() > 1) {
      std::vector<double> sorted = latencies_;
      std::sort(sorted.begin(), sorted.end());
      text += format("%-20s %8.1f Hz\n", "rate",
                     static_cast<double>(latencies_.size() - 1) / (last_refined_ - first_refined_).toSec());
      text += format("%-20s %8.0f ms median, %.0f ms max (image in to refined disparity in, over TCP)\n",
                     "latency", 1e3 * sorted[sorted.size() / 2], 1e3 * sorted.back());
    }
    text += format("\n%-20s %10s", "", "density");
    if (refined_figures_.hasScores()) {
      text += format("  %12s  %12s  %13s", ">3 px (est)", ">3 px (all)", "end-point");
    }
    text += "\n" + raw_figures_.row("raw disparity") + refined_figures_.row("refined disparity");
    if (refined_figures_.hasScores()) {
      text +=
          "est: over pixels with a disparity; all: over all pixels, holes interpolated as in KITTI's "
          "devkit\n";
    }
    std::fputs(text.c_str(), stdout);
    std::fflush(stdout);
    const std::string file = folder_ + "/report.txt";
    if (!(std::ofstream(file) << text)) throw std::runtime_error(file + " cannot be written");
  }

  bool isComplete() const { return frames_in_ > 0 && static_cast<int>(latencies_.size()) == frames_in_; }

 private:
  /// What is known of a frame until its refined map arrives.
  struct Frame {
    ros::WallTime arrival;
    Image::ConstPtr image, labels;
    Disparity::ConstPtr truth, raw, refined;
  };

  Frame& frameOf(const ros::Time& stamp) {
    last_message_ = ros::WallTime::now();
    return frames_[stamp];
  }

  void onImage(const Image::ConstPtr& image) {
    Frame& frame = frameOf(image->header.stamp);
    frame.image = image;
    frame.arrival = last_message_;
    ++frames_in_;
    finish(image->header.stamp);
  }

  void onTruth(const Disparity::ConstPtr& truth) {
    frameOf(truth->header.stamp).truth = truth;
    has_truth_ = true;
    finish(truth->header.stamp);
  }

  void onLabels(const Image::ConstPtr& labels) {
    frameOf(labels->header.stamp).labels = labels;
    finish(labels->header.stamp);
  }

  void onRaw(const Disparity::ConstPtr& raw) {
    frameOf(raw->header.stamp).raw = raw;
    finish(raw->header.stamp);
  }

  void onRefined(const Disparity::ConstPtr& refined) {
    Frame& frame = frameOf(refined->header.stamp);
    frame.refined = refined;
    last_refined_ = last_message_;
    if (latencies_.empty()) first_refined_ = last_refined_;
    latencies_.push_back(frame.arrival.isZero() ? 0.0 : (last_refined_ - frame.arrival).toSec());
    finish(refined->header.stamp);
  }

  /// Scores a frame once all of it is there.
  void finish(const ros::Time& stamp) {
    Frame& frame = frames_[stamp];
    if (!frame.image || !frame.labels || !frame.raw || !frame.refined || (has_truth_ && !frame.truth)) return;
    cv::Mat truth;
    if (frame.truth) {
      const DisparityRange range = disparityRange(*frame.truth, truth_.getTopic());
      truth =
          imageView(frame.truth->image, sensor_msgs::image_encodings::TYPE_32FC1, truth_.getTopic()).clone();
      truth.setTo(0.0F, truth < range.min);
    }
    raw_figures_.add(*frame.raw, raw_.getTopic(), truth);
    refined_figures_.add(*frame.refined, refined_.getTopic(), truth);
    if (finished_ % picture_interval_ == 0) drawPicture(frame, truth);
    ++finished_;
    frame = Frame();
  }

  void drawPicture(const Frame& frame, const cv::Mat& truth) const {
    const auto gray = grayImage(frame.image, image_.getTopic());
    const std::string encoding = sensor_msgs::image_encodings::TYPE_32FC1;
    RefinementPicture picture;
    picture.image = gray->image;
    picture.labels = imageView(*frame.labels, sensor_msgs::image_encodings::TYPE_32SC1, labels_.getTopic());
    picture.disparity = imageView(frame.raw->image, encoding, raw_.getTopic());
    picture.disparity_range = disparityRange(*frame.raw, raw_.getTopic());
    picture.refined = imageView(frame.refined->image, encoding, refined_.getTopic());
    picture.refined_range = disparityRange(*frame.refined, refined_.getTopic());
    picture.ground_truth = truth;
    const std::string file = folder_ + format("/frame_%04d.png", finished_);
    if (!cv::imwrite(file, drawRefinement(picture))) throw std::runtime_error(file + " cannot be written");
  }

  ros::NodeHandle nh_, private_nh_;
  ros::Subscriber image_, truth_, labels_, raw_, refined_;
  std::string folder_;
  double idle_timeout_ = 0.0, first_timeout_ = 0.0;
  int picture_interval_ = 0;

  int frames_in_ = 0, finished_ = 0;
  bool has_truth_ = false;
  std::map<ros::Time, Frame> frames_;
  std::vector<double> latencies_;  ///< One per refined map [s].
  ros::WallTime last_message_, first_refined_, last_refined_;
  MapFigures raw_figures_, refined_figures_;
};

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  ros::init(argc, argv, "chain_report");
  try {
    disparity_refinement::ChainReport report;
    report.watch();
    report.write();
    return report.isComplete() ? 0 : 1;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "chain_report: %s\n", e.what());
    return 1;
  }
}
