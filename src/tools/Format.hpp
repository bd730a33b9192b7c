#pragma once

#include <cstdio>
#include <string>

namespace disparity_refinement {

/// printf to a string of at most 255 characters.
template <class... Arguments>
std::string format(const char* pattern, Arguments... arguments) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, arguments...);
  return text;
}

}  // namespace disparity_refinement
