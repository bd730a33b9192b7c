#include "disparity_refinement/ros/PartnerWatch.hpp"

#include <sstream>

#include "disparity_refinement/ros/StartParameters.hpp"

namespace disparity_refinement {

PartnerWatch::PartnerWatch(const ros::NodeHandle& private_nh, StageMonitor& monitor,
                           const std::string& first_topic, const std::string& second_topic)
    : monitor_(monitor),
      first_topic_(first_topic),
      second_topic_(second_topic),
      period_(startParameter(private_nh, "sync_warning_period", 5.0, 0.1, 3600.0)),
      timer_(private_nh.createSteadyTimer(
          ros::WallDuration(period_), [this](const ros::SteadyTimerEvent&) { check(); }, false, false)) {}

void PartnerWatch::check() {
  if (joined_ == 0 && first_ + second_ > 0) {
    std::ostringstream text;
    text << "no two messages with the same stamp for " << period_ << " s; messages: " << first_topic_ << " "
         << first_ << ", " << second_topic_ << " " << second_ << "; ";
    if (first_ == 0 || second_ == 0) {
      text << "a topic without messages: does its publisher run? check the names and remaps, and what its "
              "publisher warns of";
    } else {
      text << "both need the stamp of the left image that they are made of";
    }
    monitor_.warning(text.str());
  }
  first_ = second_ = joined_ = 0;
}

}  // namespace disparity_refinement
