#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

namespace disparity_refinement {

/// Throws std::invalid_argument "<name> is <value>, expected <expected>" unless the condition holds.
template <typename Value>
void requireArgument(bool condition, const std::string& name, const Value& value,
                     const std::string& expected) {
  if (condition) return;
  std::ostringstream message;
  message << name << " is " << value << ", expected " << expected;
  throw std::invalid_argument(message.str());
}

}  // namespace disparity_refinement
