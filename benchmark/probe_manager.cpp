// A nodelet manager that starts a paused rosbag play when all its nodelets are loaded, and notes when the
// images of a stereo pair arrive in it and when the disparity maps of its nodelets are published. When
// nothing has moved for a while, or after ~duration, it writes them as JSON and ends. Started by
// live_chain.launch.
//
// The times are those that roscpp stamps on a message that it hands to a subscriber: on arrival from another
// process, or inside publish() of a nodelet. So the thread that notes them may be late.

#include <nodelet/loader.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <std_srvs/SetBool.h>
#include <stereo_msgs/DisparityImage.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace disparity_refinement {
namespace {

/// [s] that this process has used of all processors.
double processorTime() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

long peakKilobytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

long residentKilobytes() {
  long pages = 0, resident_pages = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident_pages;
  return resident_pages * (sysconf(_SC_PAGESIZE) / 1024);
}

class Probe {
 public:
  explicit Probe(bool with_refinement) : spinner_(1, &queue_) {
    nh_.setCallbackQueue(&queue_);
    listen<sensor_msgs::Image>("left/image_rect", "left");
    listen<sensor_msgs::Image>("right/image_rect", "right");
    listen<stereo_msgs::DisparityImage>("disparity", "disparity");
    if (with_refinement) listen<stereo_msgs::DisparityImage>("disparity_refined", "refined");
    spinner_.start();
  }

  ~Probe() {
    spinner_.stop();
    for (ros::Subscriber& subscriber : subscribers_) subscriber.shutdown();
  }

  /// Time since the last message, negative before the first one [s].
  double silence() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return frames_.empty() ? -1.0 : (ros::WallTime::now() - last_).toSec();
  }

  void write(const std::string& file) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    nlohmann::json frames = past_loops_;
    for (const auto& frame : frames_) frames.push_back(frame.second);
    std::ofstream(file) << nlohmann::json{{"frames", frames}, {"peak_kilobytes", peakKilobytes()}};
  }

 private:
  template <class Message>
  void listen(const std::string& topic, const std::string& name) {
    constexpr std::uint32_t QUEUE = 1000;
    using Event = ros::MessageEvent<const Message>;
    const boost::function<void(const Event&)> note = [this, name](const Event& event) {
      const std::lock_guard<std::mutex> lock(mutex_);
      last_ = ros::WallTime::now();
      auto& frame = frames_[event.getMessage()->header.stamp];
      if (frame.count(name) > 0) {
        // The bag is played again.
        past_loops_.push_back(frame);
        frame.clear();
      }
      frame[name] = event.getReceiptTime().toSec();
      frame["processor_time"] = processorTime();
      frame["resident_kilobytes"] = static_cast<double>(residentKilobytes());
    };
    subscribers_.push_back(nh_.subscribe<Message>(topic, QUEUE, note));
  }

  ros::NodeHandle nh_;
  ros::CallbackQueue queue_;
  std::vector<ros::Subscriber> subscribers_;
  mutable std::mutex mutex_;
  std::map<ros::Time, std::map<std::string, double>> frames_;
  std::vector<std::map<std::string, double>> past_loops_;
  ros::WallTime last_;
  ros::AsyncSpinner spinner_;
};

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  ros::init(argc, argv, "manager");
  const ros::NodeHandle private_nh("~");
  nodelet::Loader loader;
  const disparity_refinement::Probe probe(private_nh.param("with_refinement", false));
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const auto nodelets = static_cast<std::size_t>(private_nh.param("nodelets", 1));
  while (ros::ok() && loader.listLoadedNodelets().size() < nodelets) ros::WallDuration(0.1).sleep();
  const std::string pause = private_nh.param<std::string>("player", "/play") + "/pause_playback";
  std_srvs::SetBool resume;
  resume.request.data = 0;
  while (ros::ok() && !ros::service::call(pause, resume)) ros::WallDuration(0.1).sleep();
  constexpr double END_OF_BAG = 2.0;  // [s]
  const double duration = private_nh.param("duration", 0.0);
  const ros::WallTime begin = ros::WallTime::now();
  const auto isOver = [&] { return duration > 0.0 && (ros::WallTime::now() - begin).toSec() > duration; };
  while (ros::ok() && probe.silence() < END_OF_BAG && !isOver()) ros::WallDuration(0.1).sleep();
  probe.write(private_nh.param<std::string>("output", "live_chain.json"));
  ros::shutdown();
}
