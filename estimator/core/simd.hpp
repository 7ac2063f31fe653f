#pragma once
// The few integer vector operations that the image kernels need, behind one wrapper: AVX2, NEON
// and a scalar twin that defines the result. All three give the same bits, because the operations
// are exact integer arithmetic; kernels are templates over the instruction set, and tests run them
// with both `simd::Native` and `simd::Scalar`.

#include <cstdint>

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

namespace swiftlet::simd {

/// Sixteen 16-bit lanes, eight 32-bit sums.
struct Scalar {
  struct Int16x16 {
    std::int16_t lane[16];
  };
  struct Int32x8 {
    std::int32_t lane[8];
  };

  static Int32x8 zero() { return {}; }
  static Int16x16 load(const std::int16_t* from) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = from[i];
    return v;
  }
  /// Sixteen bytes, zero-extended.
  static Int16x16 widen(const std::uint8_t* from) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = from[i];
    return v;
  }
  static void store(std::int16_t* to, const Int16x16& v) {
    for (int i = 0; i < 16; ++i) to[i] = v.lane[i];
  }
  static Int16x16 broadcast(std::int16_t x) {
    Int16x16 v;
    for (std::int16_t& lane : v.lane) lane = x;
    return v;
  }
  /// Sums, differences and products wrap around 16 bits: callers keep within them.
  static Int16x16 add(const Int16x16& a, const Int16x16& b) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = static_cast<std::int16_t>(a.lane[i] + b.lane[i]);
    return v;
  }
  static Int16x16 subtract(const Int16x16& a, const Int16x16& b) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = static_cast<std::int16_t>(a.lane[i] - b.lane[i]);
    return v;
  }
  static Int16x16 multiply(const Int16x16& a, const Int16x16& b) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = static_cast<std::int16_t>(a.lane[i] * b.lane[i]);
    return v;
  }
  /// Fixed-point product, round(a b / 2^15); not both -2^15.
  static Int16x16 multiplyFraction(const Int16x16& a, const Int16x16& b) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) {
      v.lane[i] = static_cast<std::int16_t>((a.lane[i] * b.lane[i] + 0x4000) >> 15);
    }
    return v;
  }
  static Int16x16 bitAnd(const Int16x16& a, const Int16x16& b) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = static_cast<std::int16_t>(a.lane[i] & b.lane[i]);
    return v;
  }
  /// sum + products of neighbouring lanes, added in pairs.
  static Int32x8 multiplyAdd(Int32x8 sum, const Int16x16& a, const Int16x16& b) {
    for (int i = 0; i < 8; ++i) {
      sum.lane[i] += a.lane[2 * i] * b.lane[2 * i] + a.lane[2 * i + 1] * b.lane[2 * i + 1];
    }
    return sum;
  }
  static std::int32_t total(const Int32x8& v) {
    std::int32_t sum = 0;
    for (const std::int32_t x : v.lane) sum += x;
    return sum;
  }
};

#if defined(__AVX2__)

struct Native {
  using Int16x16 = __m256i;
  using Int32x8 = __m256i;

  static Int32x8 zero() { return _mm256_setzero_si256(); }
  static Int16x16 load(const std::int16_t* from) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
  }
  static Int16x16 widen(const std::uint8_t* from) {
    return _mm256_cvtepu8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from)));
  }
  static void store(std::int16_t* to, Int16x16 v) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), v); }
  static Int16x16 broadcast(std::int16_t x) { return _mm256_set1_epi16(x); }
  static Int16x16 add(Int16x16 a, Int16x16 b) { return _mm256_add_epi16(a, b); }
  static Int16x16 subtract(Int16x16 a, Int16x16 b) { return _mm256_sub_epi16(a, b); }
  static Int16x16 multiply(Int16x16 a, Int16x16 b) { return _mm256_mullo_epi16(a, b); }
  static Int16x16 multiplyFraction(Int16x16 a, Int16x16 b) { return _mm256_mulhrs_epi16(a, b); }
  static Int16x16 bitAnd(Int16x16 a, Int16x16 b) { return _mm256_and_si256(a, b); }
  static Int32x8 multiplyAdd(Int32x8 sum, Int16x16 a, Int16x16 b) {
    return _mm256_add_epi32(sum, _mm256_madd_epi16(a, b));
  }
  static std::int32_t total(Int32x8 v) {
    __m128i s = _mm_add_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
    s = _mm_add_epi32(s, _mm_shuffle_epi32(s, 0x4E));
    s = _mm_add_epi32(s, _mm_shuffle_epi32(s, 0xB1));
    return _mm_cvtsi128_si32(s);
  }
};

#elif defined(__ARM_NEON)

struct Native {
  struct Int16x16 {
    int16x8_t low;
    int16x8_t high;
  };
  /// The order of the eight partial sums differs from the scalar twin; their total does not.
  struct Int32x8 {
    int32x4_t low;
    int32x4_t high;
  };

  static Int32x8 zero() { return {vdupq_n_s32(0), vdupq_n_s32(0)}; }
  static Int16x16 load(const std::int16_t* from) { return {vld1q_s16(from), vld1q_s16(from + 8)}; }
  static Int16x16 widen(const std::uint8_t* from) {
    const uint8x16_t bytes = vld1q_u8(from);
    return {vreinterpretq_s16_u16(vmovl_u8(vget_low_u8(bytes))),
            vreinterpretq_s16_u16(vmovl_u8(vget_high_u8(bytes)))};
  }
  static void store(std::int16_t* to, const Int16x16& v) {
    vst1q_s16(to, v.low);
    vst1q_s16(to + 8, v.high);
  }
  static Int16x16 broadcast(std::int16_t x) { return {vdupq_n_s16(x), vdupq_n_s16(x)}; }
  static Int16x16 add(const Int16x16& a, const Int16x16& b) {
    return {vaddq_s16(a.low, b.low), vaddq_s16(a.high, b.high)};
  }
  static Int16x16 subtract(const Int16x16& a, const Int16x16& b) {
    return {vsubq_s16(a.low, b.low), vsubq_s16(a.high, b.high)};
  }
  static Int16x16 multiply(const Int16x16& a, const Int16x16& b) {
    return {vmulq_s16(a.low, b.low), vmulq_s16(a.high, b.high)};
  }
  static Int16x16 multiplyFraction(const Int16x16& a, const Int16x16& b) {
    return {vqrdmulhq_s16(a.low, b.low), vqrdmulhq_s16(a.high, b.high)};
  }
  static Int16x16 bitAnd(const Int16x16& a, const Int16x16& b) {
    return {vandq_s16(a.low, b.low), vandq_s16(a.high, b.high)};
  }
  static Int32x8 multiplyAdd(Int32x8 sum, const Int16x16& a, const Int16x16& b) {
    sum.low = vmlal_s16(sum.low, vget_low_s16(a.low), vget_low_s16(b.low));
    sum.high = vmlal_s16(sum.high, vget_high_s16(a.low), vget_high_s16(b.low));
    sum.low = vmlal_s16(sum.low, vget_low_s16(a.high), vget_low_s16(b.high));
    sum.high = vmlal_s16(sum.high, vget_high_s16(a.high), vget_high_s16(b.high));
    return sum;
  }
  static std::int32_t total(const Int32x8& v) {
    const int32x4_t sum = vaddq_s32(v.low, v.high);
    const int32x2_t half = vadd_s32(vget_low_s32(sum), vget_high_s32(sum));
    return vget_lane_s32(vpadd_s32(half, half), 0);
  }
};

#else

using Native = Scalar;

#endif

}  // namespace swiftlet::simd
