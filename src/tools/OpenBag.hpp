#pragma once

#include <rosbag/bag.h>

#include <string>

namespace disparity_refinement {

/// Opens a bag for reading. Throws std::runtime_error that names the file and says what was expected, if it
/// is no bag, or one without a complete index: of a recording or a copy that was cut off.
void openBag(const std::string& file, rosbag::Bag& bag);

}  // namespace disparity_refinement
