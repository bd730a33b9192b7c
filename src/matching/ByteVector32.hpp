#pragma once

#include <immintrin.h>

#include <cstdint>

namespace disparity_refinement {
// Nothing here may be shared between files that are compiled for different processors.
namespace {

/// 32 bytes in a register of AVX2. The operations are those of ByteVector16.
struct ByteVector32 {
  static constexpr int LANES = 32;

  __m256i v;

  ByteVector32() = default;
  explicit ByteVector32(__m256i vector) : v(vector) {}

  static ByteVector32 all(std::uint8_t value) {
    return ByteVector32(_mm256_set1_epi8(static_cast<char>(value)));
  }
  static ByteVector32 load(const std::uint8_t* bytes) {
    return ByteVector32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(bytes)));
  }
  void store(std::uint8_t* bytes) const { _mm256_storeu_si256(reinterpret_cast<__m256i*>(bytes), v); }
};

inline ByteVector32 least(ByteVector32 a, ByteVector32 b) { return ByteVector32(_mm256_min_epu8(a.v, b.v)); }
inline ByteVector32 add(ByteVector32 a, ByteVector32 b) { return ByteVector32(_mm256_adds_epu8(a.v, b.v)); }
inline ByteVector32 subtract(ByteVector32 a, ByteVector32 b) {
  return ByteVector32(_mm256_subs_epu8(a.v, b.v));
}
inline ByteVector32 difference(ByteVector32 a, ByteVector32 b) {
  return ByteVector32(_mm256_sub_epi8(_mm256_max_epu8(a.v, b.v), _mm256_min_epu8(a.v, b.v)));
}
inline ByteVector32 average(ByteVector32 a, ByteVector32 b) {
  return ByteVector32(_mm256_avg_epu8(a.v, b.v));
}
inline ByteVector32 equal(ByteVector32 a, ByteVector32 b) {
  return ByteVector32(_mm256_cmpeq_epi8(a.v, b.v));
}
inline ByteVector32 choose(ByteVector32 mask, ByteVector32 a, ByteVector32 b) {
  return ByteVector32(_mm256_blendv_epi8(b.v, a.v, mask.v));
}
inline ByteVector32 both(ByteVector32 a, ByteVector32 b) { return ByteVector32(_mm256_and_si256(a.v, b.v)); }
inline ByteVector32 either(ByteVector32 a, ByteVector32 b) { return ByteVector32(_mm256_or_si256(a.v, b.v)); }

inline ByteVector32 differingBits(ByteVector32 a0, ByteVector32 a1, ByteVector32 b0, ByteVector32 b1) {
  const __m256i counts = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4,  //
                                          0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
  const __m256i low = _mm256_set1_epi8(15);
  const auto count = [&](__m256i x) {
    return _mm256_add_epi8(_mm256_shuffle_epi8(counts, _mm256_and_si256(x, low)),
                           _mm256_shuffle_epi8(counts, _mm256_and_si256(_mm256_srli_epi16(x, 4), low)));
  };
  return ByteVector32(
      _mm256_add_epi8(count(_mm256_xor_si256(a0.v, b0.v)), count(_mm256_xor_si256(a1.v, b1.v))));
}

inline ByteVector32 fromLaneBelow(ByteVector32 a) {
  const __m256i fill = _mm256_set1_epi8(-1);
  return ByteVector32(_mm256_alignr_epi8(a.v, _mm256_permute2x128_si256(a.v, fill, 0x02), 15));
}

inline ByteVector32 fromLaneAbove(ByteVector32 a) {
  const __m256i fill = _mm256_set1_epi8(-1);
  return ByteVector32(_mm256_alignr_epi8(_mm256_permute2x128_si256(a.v, fill, 0x21), a.v, 1));
}

inline ByteVector32 leastOfLanes(ByteVector32 a) {
  __m128i v = _mm_min_epu8(_mm256_castsi256_si128(a.v), _mm256_extracti128_si256(a.v, 1));
  v = _mm_min_epu8(v, _mm_srli_epi16(v, 8));  // Pairs: the least of them is a 16-bit number.
  return ByteVector32(_mm256_broadcastb_epi8(_mm_minpos_epu16(v)));
}

inline int sumOfLanes(ByteVector32 a) {
  const __m256i sums = _mm256_sad_epu8(a.v, _mm256_setzero_si256());  // Of eight bytes each.
  const __m128i sum = _mm_add_epi64(_mm256_castsi256_si128(sums), _mm256_extracti128_si256(sums, 1));
  return _mm_cvtsi128_si32(sum) + _mm_extract_epi16(sum, 4);
}

inline std::uint32_t bitsOf(ByteVector32 mask) {
  return static_cast<std::uint32_t>(_mm256_movemask_epi8(mask.v));
}

}  // namespace
}  // namespace disparity_refinement
