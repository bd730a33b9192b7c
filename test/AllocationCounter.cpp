#include "AllocationCounter.hpp"

#include <malloc.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>

namespace disparity_refinement {
namespace {

std::atomic<bool> is_counting{false};
std::atomic<std::size_t> least_size{1};
std::atomic<long> allocation_count{0};
std::atomic<std::ptrdiff_t> bytes{0};

}  // namespace

void startCounting(std::size_t min_size) {
  least_size = min_size;
  allocation_count = 0;
  bytes = 0;
  is_counting = true;
}

Allocations stopCounting() {
  is_counting = false;
  return {allocation_count, bytes};
}

// As gcc says it, and clang.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define HAS_SANITIZER
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define HAS_SANITIZER
#endif
#endif

#ifdef HAS_SANITIZER

bool canCountAllocations() { return false; }

#else

bool canCountAllocations() { return true; }

namespace {

void* counted(void* block) {
  if (block == nullptr || !is_counting) return block;
  const std::size_t size = malloc_usable_size(block);
  bytes += static_cast<std::ptrdiff_t>(size);
  if (size >= least_size) ++allocation_count;
  return block;
}

void uncounted(void* block) {
  if (block != nullptr && is_counting) bytes -= static_cast<std::ptrdiff_t>(malloc_usable_size(block));
}

}  // namespace

// The names that glibc lets a program define itself; operator new and OpenCV come down to them.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* block);

void* malloc(std::size_t size) { return counted(__libc_malloc(size)); }
void* calloc(std::size_t count, std::size_t size) { return counted(__libc_calloc(count, size)); }
void* realloc(void* block, std::size_t size) {
  uncounted(block);
  return counted(__libc_realloc(block, size));
}
void* memalign(std::size_t alignment, std::size_t size) { return counted(__libc_memalign(alignment, size)); }
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  return counted(__libc_memalign(alignment, size));
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  *block = counted(__libc_memalign(alignment, size));
  return *block == nullptr ? ENOMEM : 0;
}
void free(void* block) {
  uncounted(block);
  __libc_free(block);
}
}

#endif

}  // namespace disparity_refinement
