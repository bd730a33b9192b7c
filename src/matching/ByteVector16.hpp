#pragma once

#include <cstdint>
#include <opencv2/core.hpp>  // What intrin.hpp needs where it emulates vectors.
#include <opencv2/core/hal/intrin.hpp>

namespace disparity_refinement {
// Nothing here may be shared between files that are compiled for different processors.
namespace {

/// 16 bytes in a register: SSE2, NEON or what OpenCV's universal intrinsics are here.
struct ByteVector16 {
  static constexpr int LANES = 16;

  cv::v_uint8x16 v;

  ByteVector16() = default;
  explicit ByteVector16(const cv::v_uint8x16& vector) : v(vector) {}

  static ByteVector16 all(std::uint8_t value) { return ByteVector16(cv::v_setall_u8(value)); }
  static ByteVector16 load(const std::uint8_t* bytes) { return ByteVector16(cv::v_load(bytes)); }
  void store(std::uint8_t* bytes) const { cv::v_store(bytes, v); }
};

inline ByteVector16 least(const ByteVector16& a, const ByteVector16& b) {
  return ByteVector16(cv::v_min(a.v, b.v));
}

/// Up to 255.
inline ByteVector16 add(const ByteVector16& a, const ByteVector16& b) { return ByteVector16(a.v + b.v); }

/// Down to 0.
inline ByteVector16 subtract(const ByteVector16& a, const ByteVector16& b) { return ByteVector16(a.v - b.v); }

inline ByteVector16 difference(const ByteVector16& a, const ByteVector16& b) {
  return ByteVector16(cv::v_absdiff(a.v, b.v));
}

/// (a + b + 1) / 2. OpenCV has none.
inline ByteVector16 average(const ByteVector16& a, const ByteVector16& b) {
#if CV_SIMD128_CPP || !(CV_SSE2 || CV_NEON)
  const cv::v_uint8x16 half = cv::v_reinterpret_as_u8(cv::v_reinterpret_as_u16(a.v ^ b.v) >> 1);
  return ByteVector16((a.v | b.v) - (half & cv::v_setall_u8(127)));
#elif CV_SSE2
  return ByteVector16(cv::v_uint8x16(_mm_avg_epu8(a.v.val, b.v.val)));
#else
  return ByteVector16(cv::v_uint8x16(vrhaddq_u8(a.v.val, b.v.val)));
#endif
}

/// 255 where they are equal, otherwise 0.
inline ByteVector16 equal(const ByteVector16& a, const ByteVector16& b) { return ByteVector16(a.v == b.v); }

/// a where the mask is 255, b where it is 0.
inline ByteVector16 choose(const ByteVector16& mask, const ByteVector16& a, const ByteVector16& b) {
  return ByteVector16(cv::v_select(mask.v, a.v, b.v));
}

inline ByteVector16 both(const ByteVector16& a, const ByteVector16& b) { return ByteVector16(a.v & b.v); }
inline ByteVector16 either(const ByteVector16& a, const ByteVector16& b) { return ByteVector16(a.v | b.v); }

/// Number of bits in which a0, a1 differ from b0, b1.
inline ByteVector16 differingBits(const ByteVector16& a0, const ByteVector16& a1, const ByteVector16& b0,
                                  const ByteVector16& b1) {
  const cv::v_uint8x16 x0 = a0.v ^ b0.v, x1 = a1.v ^ b1.v;
#if CV_SSE2 && !CV_SIMD128_CPP
  // No instruction counts bits: those of both bytes together, in groups of 2, 4 and 8.
  const auto upper = [](__m128i x, int bits, char mask) {
    return _mm_and_si128(_mm_srli_epi16(x, bits), _mm_set1_epi8(mask));
  };
  const auto lower = [](__m128i x, char mask) { return _mm_and_si128(x, _mm_set1_epi8(mask)); };
  const auto twos = [&](__m128i x) { return _mm_sub_epi8(x, upper(x, 1, 0x55)); };
  const auto fours = [&](__m128i x) { return _mm_add_epi8(lower(x, 0x33), upper(x, 2, 0x33)); };
  const __m128i sum = _mm_add_epi8(fours(twos(x0.val)), fours(twos(x1.val)));
  return ByteVector16(cv::v_uint8x16(_mm_add_epi8(lower(sum, 0x0f), upper(sum, 4, 0x0f))));
#else
  return ByteVector16(cv::v_popcount(x0) + cv::v_popcount(x1));
#endif
}

/// Lane i takes lane i - 1; lane 0 takes 255.
inline ByteVector16 fromLaneBelow(const ByteVector16& a) {
  return ByteVector16(cv::v_rotate_left<1>(a.v, cv::v_setall_u8(255)));
}

/// Lane i takes lane i + 1; the last one takes 255.
inline ByteVector16 fromLaneAbove(const ByteVector16& a) {
  return ByteVector16(cv::v_rotate_right<1>(a.v, cv::v_setall_u8(255)));
}

/// The least of all lanes, in every lane.
inline ByteVector16 leastOfLanes(const ByteVector16& a) {
  cv::v_uint8x16 v = cv::v_min(a.v, cv::v_rotate_right<8>(a.v));
  v = cv::v_min(v, cv::v_rotate_right<4>(v));
  v = cv::v_min(v, cv::v_rotate_right<2>(v));
  v = cv::v_min(v, cv::v_rotate_right<1>(v));
  return ByteVector16::all(v.get0());
}

/// Of all lanes.
inline int sumOfLanes(const ByteVector16& a) {
#if CV_SSE2 && !CV_SIMD128_CPP
  const __m128i sums = _mm_sad_epu8(a.v.val, _mm_setzero_si128());  // Of eight bytes each.
  return _mm_cvtsi128_si32(sums) + _mm_extract_epi16(sums, 4);
#else
  std::uint8_t bytes[ByteVector16::LANES];
  a.store(bytes);
  int sum = 0;
  for (const std::uint8_t byte : bytes) sum += byte;
  return sum;
#endif
}

/// Bit i: whether lane i of a mask is set.
inline std::uint32_t bitsOf(const ByteVector16& mask) {
  return static_cast<std::uint32_t>(cv::v_signmask(mask.v));
}

}  // namespace
}  // namespace disparity_refinement
