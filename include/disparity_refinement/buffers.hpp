#pragma once

#include <algorithm>
#include <cstddef>
#include <type_traits>
#include <vector>

namespace disparity_refinement {

/// Makes a buffer hold at least n values. The number depends on what an image shows: there is some room for
/// more, so that not every frame that has a little more of it means an allocation. What the buffer holds may
/// be lost.
/// @param usual  Numbers up to this shall not mean another allocation.
template <typename T>
void growTo(std::vector<T>& buffer, std::size_t n, std::size_t usual = 0) {
  if (buffer.capacity() < n) {
    buffer = {};  // First: no copy beside the new one.
    buffer.reserve(std::max(n + n / 8, usual));
  }
  if (buffer.size() < n) buffer.resize(n);
}

/// Memory that arrays of different types use one after the other.
class Scratch {
 public:
  /// An array of n values, which are not initialized; the array before is gone.
  template <typename T>
  T* array(std::size_t n) {
    static_assert(std::is_trivial_v<T>, "nothing is constructed");
    if (bytes_.size() < n * sizeof(T)) {
      bytes_ = {};
      bytes_.resize(n * sizeof(T));
    }
    return data<T>();
  }

  template <typename T>
  T* data() {
    return reinterpret_cast<T*>(bytes_.data());
  }
  template <typename T>
  const T* data() const {
    return reinterpret_cast<const T*>(bytes_.data());
  }

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace disparity_refinement
