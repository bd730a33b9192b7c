#pragma once

#include <ros/node_handle.h>

#include <cstddef>
#include <string>

namespace disparity_refinement {

/// A private parameter that is read once, when a nodelet starts; `fallback` if it is not set.
///
/// A value out of range is replaced by the nearest allowed one, a value of another type by `fallback`; a
/// warning says so.
int startParameter(const ros::NodeHandle& private_nh, const std::string& name, int fallback, int least,
                   int largest);
double startParameter(const ros::NodeHandle& private_nh, const std::string& name, double fallback,
                      double least, double largest);
bool startParameter(const ros::NodeHandle& private_nh, const std::string& name, bool fallback);

/// A number of frames, from `least` to 100000.
std::size_t startFrames(const ros::NodeHandle& private_nh, const std::string& name, int fallback,
                        int least = 1);

}  // namespace disparity_refinement
