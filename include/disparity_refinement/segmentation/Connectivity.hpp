#pragma once

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {

/// Neighbourhood of a pixel; one and the same for area closing, H-minima and watershed.
enum class Connectivity { FOUR = 4, EIGHT = 8 };

/// Throws std::invalid_argument if the value is neither of the two, as a number cast from a configuration may
/// be.
inline void validate(Connectivity connectivity) {
  requireArgument(connectivity == Connectivity::FOUR || connectivity == Connectivity::EIGHT, "connectivity",
                  static_cast<int>(connectivity), "4 or 8");
}

}  // namespace disparity_refinement
