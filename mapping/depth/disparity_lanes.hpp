#pragma once
// Vectors of 32 unsigned bytes, one per disparity (or pixel), for the matching kernels: AVX2, NEON (64-bit
// ARM) and a scalar version that defines the result. All operations are exact, so all three give the same
// bits. Kernels are templates over the instruction set; tests run them with both `Native` and `Scalar`.

#include <bit>
#include <cstdint>

#include "estimator/core/simd.hpp"

namespace swiftlet::disparity_lanes {

inline constexpr int kLanes = 32;

struct Scalar {
  struct Bytes {
    std::uint8_t lane[kLanes];
  };

  template <typename Operation>
  static Bytes each(const Bytes& a, const Bytes& b, const Operation& operation) {
    Bytes v;
    for (int i = 0; i < kLanes; ++i) v.lane[i] = static_cast<std::uint8_t>(operation(a.lane[i], b.lane[i]));
    return v;
  }

  static Bytes load(const std::uint8_t* from) {
    Bytes v;
    for (int i = 0; i < kLanes; ++i) v.lane[i] = from[i];
    return v;
  }
  static void store(std::uint8_t* to, const Bytes& v) {
    for (int i = 0; i < kLanes; ++i) to[i] = v.lane[i];
  }
  static Bytes broadcast(std::uint8_t x) {
    Bytes v;
    for (std::uint8_t& lane : v.lane) lane = x;
    return v;
  }
  static Bytes min(const Bytes& a, const Bytes& b) {
    return each(a, b, [](int x, int y) { return x < y ? x : y; });
  }
  static Bytes max(const Bytes& a, const Bytes& b) {
    return each(a, b, [](int x, int y) { return x > y ? x : y; });
  }
  /// min(a + b, 255)
  static Bytes add(const Bytes& a, const Bytes& b) {
    return each(a, b, [](int x, int y) { return x + y > 255 ? 255 : x + y; });
  }
  /// max(a - b, 0)
  static Bytes subtract(const Bytes& a, const Bytes& b) {
    return each(a, b, [](int x, int y) { return x > y ? x - y : 0; });
  }
  /// (a + b + 1) / 2, rounded down.
  static Bytes average(const Bytes& a, const Bytes& b) {
    return each(a, b, [](int x, int y) { return (x + y + 1) >> 1; });
  }
  static Bytes bitAnd(const Bytes& a, const Bytes& b) {
    return each(a, b, [](int x, int y) { return x & y; });
  }
  static Bytes bitOr(const Bytes& a, const Bytes& b) {
    return each(a, b, [](int x, int y) { return x | y; });
  }
  static Bytes bitXor(const Bytes& a, const Bytes& b) {
    return each(a, b, [](int x, int y) { return x ^ y; });
  }
  /// 255 where a >= b, 0 elsewhere.
  static Bytes atLeast(const Bytes& a, const Bytes& b) {
    return each(a, b, [](int x, int y) { return x >= y ? 255 : 0; });
  }
  static Bytes equal(const Bytes& a, const Bytes& b) {
    return each(a, b, [](int x, int y) { return x == y ? 255 : 0; });
  }
  /// Lanes of `a` where `mask` is 255, of `b` where it is 0.
  static Bytes select(const Bytes& mask, const Bytes& a, const Bytes& b) {
    Bytes v;
    for (int i = 0; i < kLanes; ++i) v.lane[i] = mask.lane[i] != 0 ? a.lane[i] : b.lane[i];
    return v;
  }
  /// Number of set bits of each lane.
  static Bytes bitCount(const Bytes& a) {
    return each(a, a, [](int x, int) { return std::popcount(static_cast<unsigned>(x)); });
  }
  /// Lane i gets lane i - 1 of `v`, lane 0 the last of `below`.
  static Bytes shiftUp(const Bytes& below, const Bytes& v) {
    Bytes u;
    u.lane[0] = below.lane[kLanes - 1];
    for (int i = 1; i < kLanes; ++i) u.lane[i] = v.lane[i - 1];
    return u;
  }
  /// Lane i gets lane i + 1 of `v`, the last lane the first of `above`.
  static Bytes shiftDown(const Bytes& v, const Bytes& above) {
    Bytes u;
    for (int i = 0; i + 1 < kLanes; ++i) u.lane[i] = v.lane[i + 1];
    u.lane[kLanes - 1] = above.lane[0];
    return u;
  }
  static std::uint8_t least(const Bytes& v) {
    std::uint8_t x = v.lane[0];
    for (const std::uint8_t lane : v.lane) x = lane < x ? lane : x;
    return x;
  }
  /// The least of the lanes in every lane.
  static Bytes spreadLeast(const Bytes& v) { return broadcast(least(v)); }
  static std::uint8_t last(const Bytes& v) { return v.lane[kLanes - 1]; }
  /// Index of the first set lane of a mask of 0 and 255; kLanes if there is none.
  static int firstSet(const Bytes& mask) {
    for (int i = 0; i < kLanes; ++i) {
      if (mask.lane[i] != 0) return i;
    }
    return kLanes;
  }
};

#if defined(__AVX2__) && defined(__FMA__)

struct Native {
  using Bytes = __m256i;

  static Bytes load(const std::uint8_t* from) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
  }
  static void store(std::uint8_t* to, Bytes v) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), v); }
  static Bytes broadcast(std::uint8_t x) { return _mm256_set1_epi8(static_cast<char>(x)); }
  static Bytes min(Bytes a, Bytes b) { return _mm256_min_epu8(a, b); }
  static Bytes max(Bytes a, Bytes b) { return _mm256_max_epu8(a, b); }
  static Bytes add(Bytes a, Bytes b) { return _mm256_adds_epu8(a, b); }
  static Bytes subtract(Bytes a, Bytes b) { return _mm256_subs_epu8(a, b); }
  static Bytes average(Bytes a, Bytes b) { return _mm256_avg_epu8(a, b); }
  static Bytes bitAnd(Bytes a, Bytes b) { return _mm256_and_si256(a, b); }
  static Bytes bitOr(Bytes a, Bytes b) { return _mm256_or_si256(a, b); }
  static Bytes bitXor(Bytes a, Bytes b) { return _mm256_xor_si256(a, b); }
  static Bytes atLeast(Bytes a, Bytes b) { return _mm256_cmpeq_epi8(_mm256_max_epu8(a, b), a); }
  static Bytes equal(Bytes a, Bytes b) { return _mm256_cmpeq_epi8(a, b); }
  static Bytes select(Bytes mask, Bytes a, Bytes b) { return _mm256_blendv_epi8(b, a, mask); }
  static Bytes bitCount(Bytes a) {
    const __m256i ones = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, 0, 1, 1, 2, 1, 2, 2,
                                          3, 1, 2, 2, 3, 2, 3, 3, 4);
    const __m256i low = _mm256_set1_epi8(0x0F);
    return _mm256_add_epi8(_mm256_shuffle_epi8(ones, _mm256_and_si256(a, low)),
                           _mm256_shuffle_epi8(ones, _mm256_and_si256(_mm256_srli_epi16(a, 4), low)));
  }
  static Bytes shiftUp(Bytes below, Bytes v) {
    return _mm256_alignr_epi8(v, _mm256_permute2x128_si256(below, v, 0x21), 15);
  }
  static Bytes shiftDown(Bytes v, Bytes above) {
    return _mm256_alignr_epi8(_mm256_permute2x128_si256(v, above, 0x21), v, 1);
  }
  static std::uint8_t least(Bytes v) { return static_cast<std::uint8_t>(_mm_cvtsi128_si32(leastOfAll(v))); }
  static Bytes spreadLeast(Bytes v) { return _mm256_broadcastb_epi8(leastOfAll(v)); }
  static std::uint8_t last(Bytes v) { return static_cast<std::uint8_t>(_mm256_extract_epi8(v, kLanes - 1)); }
  static int firstSet(Bytes mask) {
    return std::countr_zero(static_cast<std::uint32_t>(_mm256_movemask_epi8(mask)));
  }

 private:
  static __m128i leastOfAll(Bytes v) {
    __m128i m = _mm_min_epu8(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
    // Pairs: the smaller in the low byte, zero above it; then the least of eight words.
    m = _mm_min_epu8(m, _mm_srli_epi16(m, 8));
    return _mm_minpos_epu16(m);
  }
};

#elif defined(__aarch64__)

struct Native {
  struct Bytes {
    uint8x16_t low;
    uint8x16_t high;
  };

  static Bytes load(const std::uint8_t* from) { return {vld1q_u8(from), vld1q_u8(from + 16)}; }
  static void store(std::uint8_t* to, const Bytes& v) {
    vst1q_u8(to, v.low);
    vst1q_u8(to + 16, v.high);
  }
  static Bytes broadcast(std::uint8_t x) { return {vdupq_n_u8(x), vdupq_n_u8(x)}; }
  static Bytes min(const Bytes& a, const Bytes& b) {
    return {vminq_u8(a.low, b.low), vminq_u8(a.high, b.high)};
  }
  static Bytes max(const Bytes& a, const Bytes& b) {
    return {vmaxq_u8(a.low, b.low), vmaxq_u8(a.high, b.high)};
  }
  static Bytes add(const Bytes& a, const Bytes& b) {
    return {vqaddq_u8(a.low, b.low), vqaddq_u8(a.high, b.high)};
  }
  static Bytes subtract(const Bytes& a, const Bytes& b) {
    return {vqsubq_u8(a.low, b.low), vqsubq_u8(a.high, b.high)};
  }
  static Bytes average(const Bytes& a, const Bytes& b) {
    return {vrhaddq_u8(a.low, b.low), vrhaddq_u8(a.high, b.high)};
  }
  static Bytes bitAnd(const Bytes& a, const Bytes& b) {
    return {vandq_u8(a.low, b.low), vandq_u8(a.high, b.high)};
  }
  static Bytes bitOr(const Bytes& a, const Bytes& b) {
    return {vorrq_u8(a.low, b.low), vorrq_u8(a.high, b.high)};
  }
  static Bytes bitXor(const Bytes& a, const Bytes& b) {
    return {veorq_u8(a.low, b.low), veorq_u8(a.high, b.high)};
  }
  static Bytes atLeast(const Bytes& a, const Bytes& b) {
    return {vcgeq_u8(a.low, b.low), vcgeq_u8(a.high, b.high)};
  }
  static Bytes equal(const Bytes& a, const Bytes& b) {
    return {vceqq_u8(a.low, b.low), vceqq_u8(a.high, b.high)};
  }
  static Bytes select(const Bytes& mask, const Bytes& a, const Bytes& b) {
    return {vbslq_u8(mask.low, a.low, b.low), vbslq_u8(mask.high, a.high, b.high)};
  }
  static Bytes bitCount(const Bytes& a) { return {vcntq_u8(a.low), vcntq_u8(a.high)}; }
  static Bytes shiftUp(const Bytes& below, const Bytes& v) {
    return {vextq_u8(below.high, v.low, 15), vextq_u8(v.low, v.high, 15)};
  }
  static Bytes shiftDown(const Bytes& v, const Bytes& above) {
    return {vextq_u8(v.low, v.high, 1), vextq_u8(v.high, above.low, 1)};
  }
  static std::uint8_t least(const Bytes& v) { return vminvq_u8(vminq_u8(v.low, v.high)); }
  static Bytes spreadLeast(const Bytes& v) { return broadcast(least(v)); }
  static std::uint8_t last(const Bytes& v) { return vgetq_lane_u8(v.high, 15); }
  static int firstSet(const Bytes& mask) {
    const int low = firstOfHalf(mask.low);
    return low < 16 ? low : 16 + firstOfHalf(mask.high);
  }

 private:
  /// Four bits a lane, in order.
  static int firstOfHalf(uint8x16_t mask) {
    const uint8x8_t nibbles = vshrn_n_u16(vreinterpretq_u16_u8(mask), 4);
    return std::countr_zero(vget_lane_u64(vreinterpret_u64_u8(nibbles), 0)) / 4;
  }
};

#else

using Native = Scalar;

#endif

/// Defined if `Native` differs from `Scalar`, so that kernels are instantiated for both.
#ifdef SWIFTLET_SIMD_NATIVE
#define SWIFTLET_DISPARITY_LANES_NATIVE
#endif

}  // namespace swiftlet::disparity_lanes
