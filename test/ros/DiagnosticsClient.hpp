#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>

#include <algorithm>
#include <functional>
#include <set>
#include <string>

#include "ChainClient.hpp"

namespace disparity_refinement {

/// What a nodelet reports on /diagnostics.
class Diagnostics {
 public:
  using DiagnosticArray = diagnostic_msgs::DiagnosticArray;
  using DiagnosticStatus = diagnostic_msgs::DiagnosticStatus;

  Diagnostics(ros::NodeHandle& nh, const std::string& nodelet)
      : nodelet_(nodelet), listener_(nh, "/diagnostics") {}

  /// Waits for a report, from now on, for which `matches` holds.
  bool waitFor(const std::function<bool(const DiagnosticStatus&)>& matches, double timeout = TIMEOUT) {
    listener_.clear();
    return listener_.wait(
               [&](const DiagnosticArray& array) {
                 return std::any_of(
                     array.status.begin(), array.status.end(), [&](const DiagnosticStatus& status) {
                       return status.name.find(nodelet_) != std::string::npos && matches(status);
                     });
               },
               timeout) != nullptr;
  }

  /// A report of the state from now on: the first that comes may have been under way already.
  DiagnosticStatus next() {
    DiagnosticStatus second;
    std::set<ros::Time> stamps;
    listener_.clear();
    listener_.wait([&](const DiagnosticArray& array) {
      for (const DiagnosticStatus& status : array.status) {
        if (status.name.find(nodelet_) == std::string::npos) continue;
        stamps.insert(array.header.stamp);
        second = status;
      }
      return stamps.size() > 1;
    });
    return second;
  }

  /// The text beside a key, empty if there is no such key.
  static std::string text(const DiagnosticStatus& status, const std::string& key) {
    for (const auto& entry : status.values) {
      if (entry.key == key) return entry.value;
    }
    return {};
  }

  /// The number beside a key, -1 if there is no such key.
  static long value(const DiagnosticStatus& status, const std::string& key) {
    const std::string number = text(status, key);
    return number.empty() ? -1 : std::stol(number);
  }

 private:
  const std::string nodelet_;
  Listener<DiagnosticArray> listener_;
};

}  // namespace disparity_refinement
