#pragma once

#include <cstddef>

namespace disparity_refinement {

/// Counts what the whole process allocates: link AllocationCounter.cpp, which stands before malloc.
struct Allocations {
  long count;             ///< Allocations of at least the size asked for.
  std::ptrdiff_t growth;  ///< Bytes allocated and not freed.
};

/// False where a sanitizer has a malloc of its own: then nothing is counted.
bool canCountAllocations();

/// From here on allocations of at least min_size bytes are counted, on every thread.
void startCounting(std::size_t min_size = 1);
Allocations stopCounting();

}  // namespace disparity_refinement
