#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace disparity_refinement {

/// Counts what one nodelet does with its frames, logs its errors, and reports both on /diagnostics once a
/// second. All methods may be called from any thread.
class StageMonitor {
 public:
  StageMonitor(const std::string& name, const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);

  /// Ends the nodelet's onInit(): from here on /diagnostics is published.
  void start();

  /// Adds lines to the diagnostics of the stage. To be called before start().
  void addDiagnostics(const std::function<void(diagnostic_updater::DiagnosticStatusWrapper&)>& task);

  void received();
  void dropped(int frames = 1);
  /// A frame was published `milliseconds` after its processing had begun.
  void published(const ros::Time& stamp, double milliseconds);

  /// Logs a text, the same one at most every five seconds.
  void error(const std::string& text);
  void warning(const std::string& text);

  /// At debug level, the address of the data of a message: equal on both ends of an edge without a copy.
  void traceReceived(const std::string& topic, const ros::Time& stamp, const void* data) const;
  void tracePublished(const std::string& topic, const ros::Time& stamp, const void* data) const;

 private:
  void report(diagnostic_updater::DiagnosticStatusWrapper& status);
  /// True if the text was not logged within the last five seconds. Called with the mutex held.
  bool isDue(const std::string& text);

  const std::string name_;
  std::vector<std::function<void(diagnostic_updater::DiagnosticStatusWrapper&)>> tasks_;
  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;

  mutable std::mutex mutex_;
  struct Counts {
    long received = 0, published = 0, dropped = 0, errors = 0;
  };
  Counts total_, reported_;
  double milliseconds_sum_ = 0.0, milliseconds_max_ = 0.0, age_sum_ = 0.0;
  ros::WallTime last_report_ = ros::WallTime::now();
  std::string last_error_;
  std::map<std::string, ros::WallTime> last_logged_;
};

}  // namespace disparity_refinement
