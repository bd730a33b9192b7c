#pragma once

#include <rosbag/bag.h>

#include <string>
#include <vector>

namespace disparity_refinement {

/// Finds the rectified stereo pair of a bag. Throws std::runtime_error that names the file if it is no bag or
/// holds no pair.
///
/// @return  The arguments that make kitti.launch play it, each "NAME:=VALUE" without a line break.
std::vector<std::string> bagArguments(const std::string& file);

/// The same for a bag that is open for reading; errors do not name it.
std::vector<std::string> bagArguments(const rosbag::Bag& bag);

}  // namespace disparity_refinement
