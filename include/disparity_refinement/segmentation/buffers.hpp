#pragma once

#include <cstddef>
#include <vector>

namespace disparity_refinement {

/// Makes a buffer hold at least n values, with room for more: a size that depends on the image's content
/// should not mean an allocation for every frame that has a little more of it.
template <typename T>
void growTo(std::vector<T>& buffer, std::size_t n) {
  if (buffer.capacity() < n) buffer.reserve(n + n / 4);
  if (buffer.size() < n) buffer.resize(n);
}

}  // namespace disparity_refinement
