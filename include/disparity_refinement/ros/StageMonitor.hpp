#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <array>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace disparity_refinement {

/// Why a frame that came in is not published.
enum class DropReason {
  QUEUE_FULL,  ///< Newer ones came while it waited: too slow.
  NO_PARTNER,  ///< What it has to be joined with did not come.
  BAD,         ///< It was refused with an error.
};

/// Counts what one nodelet does with its frames, logs its errors, and reports both on /diagnostics once a
/// second. All methods may be called from any thread.
///
/// Every frame received is published or dropped for one reason, unless it is under way.
///
/// Parameters on the private handle, beyond which the report is a warning; 0 is no bound but for the second:
/// ~diagnostics_min_rate [Hz] (0), ~diagnostics_max_dropped (0), a share of the frames, 0...1, and
/// ~diagnostics_max_age [s] (0) of a frame when it is published.
class StageMonitor {
 public:
  using Task = std::function<void(diagnostic_updater::DiagnosticStatusWrapper&)>;

  StageMonitor(const std::string& name, const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);

  /// Ends the nodelet's onInit(): from here on /diagnostics is published.
  void start();

  /// Begins the nodelet's destructor: no task of addDiagnostics() is under way when it returns, nor called
  /// any more.
  void stop();

  /// Adds lines to the diagnostics of the stage. To be called before start().
  void addDiagnostics(const Task& task);

  /// Whether anybody listens to the stage, so that input is expected.
  void setActive(bool is_active);
  void received(int frames = 1);
  void dropped(DropReason reason, int frames = 1);
  /// A frame was published `milliseconds` after its processing had begun.
  void published(const ros::Time& stamp, double milliseconds);

  /// Logs a text, the same one at most every five seconds.
  void error(const std::string& text);
  void warning(const std::string& text);

  /// At debug level, the address of the data of a message: equal on both ends of an edge without a copy.
  void traceReceived(const std::string& topic, const ros::Time& stamp, const void* data) const;
  void tracePublished(const std::string& topic, const ros::Time& stamp, const void* data) const;

 private:
  static constexpr std::size_t REASONS = 3;

  struct Counts {
    long received = 0, published = 0, errors = 0;
    std::array<long, REASONS> dropped{};

    long allDropped() const;
    /// Without the bad ones, of which an error tells.
    long lost() const { return allDropped() - dropped[static_cast<std::size_t>(DropReason::BAD)]; }
  };

  /// Mean and maximum since the last report.
  struct Figure {
    double sum = 0.0, max = 0.0;

    void add(double value);
  };

  void report(diagnostic_updater::DiagnosticStatusWrapper& status);
  /// Sets the status by what has happened since the last report, `seconds` ago. Called with the mutex held.
  void summarize(double seconds, diagnostic_updater::DiagnosticStatusWrapper& status) const;
  /// True if the text was not logged within the last five seconds. Called with the mutex held.
  bool isDue(const std::string& text);

  const std::string name_;
  double min_rate_, max_dropped_, max_age_;
  std::vector<Task> tasks_;
  diagnostic_updater::Updater updater_;

  mutable std::mutex mutex_;
  bool is_active_ = true;
  Counts total_, reported_;
  Figure milliseconds_, age_;
  ros::SteadyTime last_report_ = ros::SteadyTime::now();
  std::string last_error_;
  std::map<std::string, ros::SteadyTime> last_logged_;
  ros::SteadyTimer timer_;  // last: it uses the others
};

}  // namespace disparity_refinement
