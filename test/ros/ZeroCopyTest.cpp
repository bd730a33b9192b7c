// The test loads the nodelets into its own process, as a manager does, sends images to them by pointer, and
// compares the addresses of the data that they log at debug level on both ends of every edge.

#include <gtest/gtest.h>
#include <nodelet/loader.h>
#include <ros/console.h>
#include <stereo_msgs/DisparityImage.h>

#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "ChainClient.hpp"

namespace disparity_refinement {
namespace {

using sensor_msgs::Image;
using stereo_msgs::DisparityImage;

constexpr int FRAMES = 1000;

std::string address(const std::vector<std::uint8_t>& data) {
  std::ostringstream text;
  text << static_cast<const void*>(data.data());
  return text.str();
}

/// Addresses that the log says were published or received for a topic and stamp, by nodelet. It hears every
/// line of this process, to its end: deregister_appender() of rosconsole 1.14 deletes what is deleted
/// already.
class AddressLog : public ros::console::LogAppender {
 public:
  static AddressLog& get() {
    static auto* const log = new AddressLog;
    return *log;
  }

  /// A line such as "[/stereo/segmentation] published labels 1000.000000000 at 0x..."
  void log(ros::console::Level /*level*/, const char* text, const char* /*file*/, const char* /*function*/,
           int /*line*/) override {
    const std::string line = text;
    const auto address = line.rfind(AT);
    if (address == std::string::npos) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    addresses_[line.substr(0, address)] = line.substr(address + AT.size());
    logged_.notify_all();
  }

  /// Waits for such a line.
  std::string find(const std::string& nodelet, const std::string& what, const std::string& topic,
                   const ros::Time& stamp) {
    std::ostringstream head;
    head << "[/stereo/" << nodelet << "] " << what << " " << topic << " " << stamp;
    std::unique_lock<std::mutex> lock(mutex_);
    const bool is_found = logged_.wait_for(lock, std::chrono::duration<double>(TIMEOUT),
                                           [&] { return addresses_.count(head.str()) > 0; });
    return is_found ? addresses_[head.str()] : "no line '" + head.str() + "'";
  }

  void clear() {
    const std::lock_guard<std::mutex> lock(mutex_);
    addresses_.clear();
  }

 private:
  AddressLog() { ros::console::register_appender(this); }

  const std::string AT = " at ";
  std::mutex mutex_;
  std::condition_variable logged_;
  std::map<std::string, std::string> addresses_;
};

TEST(ZeroCopy, everyEdgePassesThePointer) {
  ros::console::set_logger_level("ros.disparity_refinement", ros::console::levels::Debug);
  ros::console::notifyLoggerLevelsChanged();
  ros::NodeHandle nh;
  AddressLog& log = AddressLog::get();

  nodelet::Loader loader(nh);
  const std::map<std::string, std::string> remappings;
  const std::vector<std::string> arguments;
  for (const char* name : {"disparity", "segmentation", "plane_refinement", "depth", "visualization"}) {
    ASSERT_TRUE(loader.load(std::string("/stereo/") + name, std::string("disparity_refinement/") + name,
                            remappings, arguments));
  }

  Listener<DisparityImage> raw(nh, "disparity"), refined(nh, "disparity_refined");
  Listener<Image> labels(nh, "labels"), depth(nh, "depth/image_rect"), raw_picture(nh, "disparity_color"),
      refined_picture(nh, "disparity_refined_color");
  Listener<Image> labels_picture(nh, "labels_color"), borders(nh, "segment_borders");
  // Small images: what counts is that there are many of them.
  StreetParameters street;
  street.width = 128;
  street.height = 48;
  street.focal_length = 80.0;
  StereoCamera camera(nh, street);
  for (auto* picture : {&depth, &raw_picture, &refined_picture, &labels_picture, &borders}) {
    ASSERT_TRUE(camera.waitForChain(*picture));
  }

  std::vector<StreetFrame> drive;
  for (int i = 0; i < 5; ++i) drive.push_back(camera.street().render(i));

  for (int i = 0; i < FRAMES && !testing::Test::HasFailure(); ++i) {
    for (auto* listener : {&raw, &refined}) listener->clear();
    for (auto* listener : {&labels, &depth, &raw_picture, &refined_picture, &labels_picture, &borders})
      listener->clear();
    log.clear();
    const ros::Time stamp = camera.stamp(i);
    const StreetFrame& frame = drive[i % drive.size()];
    const StereoMessages sent = camera.make(frame.left, frame.right, stamp);
    camera.publish(sent);
    const auto raw_message = raw.wait(stamp);
    const auto labels_message = labels.wait(stamp);
    const auto refined_message = refined.wait(stamp);
    ASSERT_TRUE(raw_message && labels_message && refined_message && depth.wait(stamp) && borders.wait(stamp));

    // Into the chain: from the pointer that was published.
    const std::string left = address(sent.left->data);
    EXPECT_EQ(log.find("disparity", "received", "left/image_rect", stamp), left);
    EXPECT_EQ(log.find("disparity", "received", "right/image_rect", stamp), address(sent.right->data));
    EXPECT_EQ(log.find("segmentation", "received", "left/image_rect", stamp), left);
    EXPECT_EQ(log.find("visualization", "received", "left/image_rect", stamp), left);
    EXPECT_EQ(log.find("plane_refinement", "received", "left/image_rect", stamp), left);

    // Inside the chain: from publisher to subscriber.
    const std::string disparity = log.find("disparity", "published", "disparity", stamp);
    EXPECT_EQ(log.find("plane_refinement", "received", "disparity", stamp), disparity);
    EXPECT_EQ(log.find("visualization", "received", "disparity", stamp), disparity);
    const std::string labels_address = log.find("segmentation", "published", "labels", stamp);
    EXPECT_EQ(log.find("plane_refinement", "received", "labels", stamp), labels_address);
    EXPECT_EQ(log.find("visualization", "received", "labels", stamp), labels_address);
    const std::string refined_address = log.find("plane_refinement", "published", "disparity_refined", stamp);
    EXPECT_EQ(log.find("visualization", "received", "disparity_refined", stamp), refined_address);
    EXPECT_EQ(log.find("depth", "received", "disparity_refined", stamp), refined_address);

    // Out of the chain: to a subscriber in the same process.
    EXPECT_EQ(address(raw_message->image.data), disparity);
    EXPECT_EQ(address(labels_message->data), labels_address);
    EXPECT_EQ(address(refined_message->image.data), refined_address);

    const std::set<std::string> distinct = {left, disparity, labels_address, refined_address};
    EXPECT_EQ(distinct.size(), 4U);
  }
}

}  // namespace
}  // namespace disparity_refinement
