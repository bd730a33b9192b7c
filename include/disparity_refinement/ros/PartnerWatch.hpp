#pragma once

#include <ros/ros.h>

#include <string>

#include "disparity_refinement/ros/StageMonitor.hpp"

namespace disparity_refinement {

/// Warns when messages come on one or both of two topics, but no two with the same stamp, for
/// ~sync_warning_period [s] (5). To be used by the callbacks of one nodelet's single-threaded queue.
class PartnerWatch {
 public:
  PartnerWatch(const ros::NodeHandle& private_nh, StageMonitor& monitor, const std::string& first_topic,
               const std::string& second_topic);

  void receivedFirst() { ++first_; }
  void receivedSecond() { ++second_; }
  void joined() { ++joined_; }

  void start() { timer_.start(); }
  /// No callback is under way when it returns.
  void stop() { timer_.stop(); }

 private:
  void check();

  StageMonitor& monitor_;
  const std::string first_topic_, second_topic_;
  const double period_;                       ///< [s]
  long first_ = 0, second_ = 0, joined_ = 0;  ///< Since the last check.
  ros::SteadyTimer timer_;
};

}  // namespace disparity_refinement
