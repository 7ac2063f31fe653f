#pragma once
// The vector operations of the image kernels behind one wrapper: AVX2, NEON (64-bit ARM) and a scalar version
// that defines the result. All three give the same bits: integer operations are exact, float operations are
// rounded once (products are fused with their sums). Kernels are templates over the instruction set, and
// tests run them with both `simd::Native` and `simd::Scalar`.

#include <cmath>
#include <cstdint>

// If Native is not Scalar, kernels are instantiated for both.
#if defined(__AVX2__) && defined(__FMA__)
#define SWIFTLET_SIMD_NATIVE
#include <immintrin.h>
#elif defined(__aarch64__)
#define SWIFTLET_SIMD_NATIVE
#include <arm_neon.h>
#endif

namespace swiftlet::simd {

/// Sixteen 16-bit lanes, eight 32-bit sums, sixteen float lanes.
struct Scalar {
  struct Int16x16 {
    std::int16_t lane[16];
  };
  struct Int32x8 {
    std::int32_t lane[8];
  };
  struct Float32x16 {
    float lane[16];
  };
  /// Indices into two rows of 16 bytes, one row for each half of the lanes.
  struct Places {
    std::int16_t lane[16];
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
  /// Sums, differences and products wrap around at 16 bits; callers must avoid overflow.
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
  /// sum + products, where the products of neighbouring lanes are added in pairs.
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

  template <int kBits>
  static Int16x16 shiftLeft(const Int16x16& a) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = static_cast<std::int16_t>(a.lane[i] << kBits);
    return v;
  }
  /// Rounds towards minus infinity.
  template <int kBits>
  static Int16x16 shiftRight(const Int16x16& a) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = static_cast<std::int16_t>(a.lane[i] >> kBits);
    return v;
  }
  /// Interprets lanes as unsigned.
  template <int kBits>
  static Int16x16 shiftRightUnsigned(const Int16x16& a) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) {
      v.lane[i] = static_cast<std::int16_t>(static_cast<std::uint16_t>(a.lane[i]) >> kBits);
    }
    return v;
  }
  /// The values at even and at odd positions of the 32 values of `a` and `b`.
  static Int16x16 even(const Int16x16& a, const Int16x16& b) {
    Int16x16 v;
    for (int i = 0; i < 8; ++i) {
      v.lane[i] = a.lane[2 * i];
      v.lane[i + 8] = b.lane[2 * i];
    }
    return v;
  }
  static Int16x16 odd(const Int16x16& a, const Int16x16& b) {
    Int16x16 v;
    for (int i = 0; i < 8; ++i) {
      v.lane[i] = a.lane[2 * i + 1];
      v.lane[i + 8] = b.lane[2 * i + 1];
    }
    return v;
  }
  /// Lanes of `a` where `key` equals `value`, of `b` elsewhere.
  static Int16x16 selectEqual(const Int16x16& key, std::int16_t value, const Int16x16& a, const Int16x16& b) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = key.lane[i] == value ? a.lane[i] : b.lane[i];
    return v;
  }
  /// Converts lanes to unsigned bytes, clamped to 0 and 255.
  static void storeBytes(std::uint8_t* to, const Int16x16& v) {
    for (int i = 0; i < 16; ++i) {
      to[i] = static_cast<std::uint8_t>(v.lane[i] < 0 ? 0 : (v.lane[i] > 255 ? 255 : v.lane[i]));
    }
  }
  static Places places(const Int16x16& v) {
    Places p;
    for (int i = 0; i < 16; ++i) p.lane[i] = v.lane[i];
    return p;
  }
  /// low[place] for the first eight lanes, high[place] for the others. Places are 0 to 15; lanes with other
  /// places are undefined. Reads 16 bytes of each.
  static Int16x16 pick(const std::uint8_t* low, const std::uint8_t* high, const Places& place) {
    Int16x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = (i < 8 ? low : high)[place.lane[i] & 15];
    return v;
  }

  static Float32x16 loadFloats(const float* from) {
    Float32x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = from[i];
    return v;
  }
  static void storeFloats(float* to, const Float32x16& v) {
    for (int i = 0; i < 16; ++i) to[i] = v.lane[i];
  }
  static Float32x16 broadcastFloat(float x) {
    Float32x16 v;
    for (float& lane : v.lane) lane = x;
    return v;
  }
  static Float32x16 toFloats(const Int16x16& a) {
    Float32x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = a.lane[i];
    return v;
  }
  static Float32x16 multiply(const Float32x16& a, const Float32x16& b) {
    Float32x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = a.lane[i] * b.lane[i];
    return v;
  }
  static Float32x16 add(const Float32x16& a, const Float32x16& b) {
    Float32x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = a.lane[i] + b.lane[i];
    return v;
  }
  static Float32x16 subtract(const Float32x16& a, const Float32x16& b) {
    Float32x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = a.lane[i] - b.lane[i];
    return v;
  }
  static Float32x16 squareRoot(const Float32x16& a) {
    Float32x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = std::sqrt(a.lane[i]);
    return v;
  }
  static bool anyAbove(const Float32x16& a, float limit) {
    bool any = false;
    for (const float lane : a.lane) any = any || lane > limit;
    return any;
  }
  /// sum + a b, rounded once.
  static Float32x16 multiplyAdd(const Float32x16& sum, const Float32x16& a, const Float32x16& b) {
    Float32x16 v;
    for (int i = 0; i < 16; ++i) v.lane[i] = std::fma(a.lane[i], b.lane[i], sum.lane[i]);
    return v;
  }
};

#if defined(__AVX2__) && defined(__FMA__)

struct Native {
  using Int16x16 = __m256i;
  using Int32x8 = __m256i;
  struct Float32x16 {
    __m256 low;
    __m256 high;
  };
  using Places = __m256i;  ///< of the low bytes; a high byte's top bit makes it zero

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

  template <int kBits>
  static Int16x16 shiftLeft(Int16x16 a) {
    return _mm256_slli_epi16(a, kBits);
  }
  template <int kBits>
  static Int16x16 shiftRight(Int16x16 a) {
    return _mm256_srai_epi16(a, kBits);
  }
  template <int kBits>
  static Int16x16 shiftRightUnsigned(Int16x16 a) {
    return _mm256_srli_epi16(a, kBits);
  }
  static Int16x16 even(Int16x16 a, Int16x16 b) {
    const __m256i low = _mm256_set1_epi32(0xFFFF);
    return inOrder(_mm256_packus_epi32(_mm256_and_si256(a, low), _mm256_and_si256(b, low)));
  }
  static Int16x16 odd(Int16x16 a, Int16x16 b) {
    return inOrder(_mm256_packus_epi32(_mm256_srli_epi32(a, 16), _mm256_srli_epi32(b, 16)));
  }
  static Int16x16 selectEqual(Int16x16 key, std::int16_t value, Int16x16 a, Int16x16 b) {
    return _mm256_blendv_epi8(b, a, _mm256_cmpeq_epi16(key, _mm256_set1_epi16(value)));
  }
  static void storeBytes(std::uint8_t* to, Int16x16 v) {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(to), bytes(v));
  }
  static Places places(Int16x16 v) { return _mm256_or_si256(v, _mm256_set1_epi16(-0x8000)); }
  static Int16x16 pick(const std::uint8_t* low, const std::uint8_t* high, Places place) {
    const __m128i first = _mm_loadu_si128(reinterpret_cast<const __m128i*>(low));
    const __m128i second = _mm_loadu_si128(reinterpret_cast<const __m128i*>(high));
    return _mm256_shuffle_epi8(_mm256_set_m128i(second, first), place);
  }

  static Float32x16 loadFloats(const float* from) {
    return {_mm256_loadu_ps(from), _mm256_loadu_ps(from + 8)};
  }
  static void storeFloats(float* to, const Float32x16& v) {
    _mm256_storeu_ps(to, v.low);
    _mm256_storeu_ps(to + 8, v.high);
  }
  static Float32x16 broadcastFloat(float x) { return {_mm256_set1_ps(x), _mm256_set1_ps(x)}; }
  static Float32x16 toFloats(Int16x16 a) {
    return {_mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm256_castsi256_si128(a))),
            _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm256_extracti128_si256(a, 1)))};
  }
  static Float32x16 multiply(const Float32x16& a, const Float32x16& b) {
    return {_mm256_mul_ps(a.low, b.low), _mm256_mul_ps(a.high, b.high)};
  }
  static Float32x16 add(const Float32x16& a, const Float32x16& b) {
    return {_mm256_add_ps(a.low, b.low), _mm256_add_ps(a.high, b.high)};
  }
  static Float32x16 subtract(const Float32x16& a, const Float32x16& b) {
    return {_mm256_sub_ps(a.low, b.low), _mm256_sub_ps(a.high, b.high)};
  }
  static Float32x16 squareRoot(const Float32x16& a) {
    return {_mm256_sqrt_ps(a.low), _mm256_sqrt_ps(a.high)};
  }
  static bool anyAbove(const Float32x16& a, float limit) {
    const __m256 l = _mm256_set1_ps(limit);
    return _mm256_movemask_ps(
               _mm256_or_ps(_mm256_cmp_ps(a.low, l, _CMP_GT_OQ), _mm256_cmp_ps(a.high, l, _CMP_GT_OQ))) != 0;
  }
  static Float32x16 multiplyAdd(const Float32x16& sum, const Float32x16& a, const Float32x16& b) {
    return {_mm256_fmadd_ps(a.low, b.low, sum.low), _mm256_fmadd_ps(a.high, b.high, sum.high)};
  }

 private:
  /// Quarters of two packed vectors come out interleaved.
  static __m256i inOrder(__m256i v) { return _mm256_permute4x64_epi64(v, 0xD8); }
  static __m128i bytes(Int16x16 v) {
    return _mm_packus_epi16(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
  }
};

#elif defined(__aarch64__)

struct Native {
  struct Int16x16 {
    int16x8_t low;
    int16x8_t high;
  };
  /// The order of the eight partial sums differs from the scalar version; their total does not.
  struct Int32x8 {
    int32x4_t low;
    int32x4_t high;
  };
  struct Float32x16 {
    float32x4_t quarter[4];
  };
  using Places = uint8x16_t;

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

  template <int kBits>
  static Int16x16 shiftLeft(const Int16x16& a) {
    return {vshlq_n_s16(a.low, kBits), vshlq_n_s16(a.high, kBits)};
  }
  template <int kBits>
  static Int16x16 shiftRight(const Int16x16& a) {
    return {vshrq_n_s16(a.low, kBits), vshrq_n_s16(a.high, kBits)};
  }
  template <int kBits>
  static Int16x16 shiftRightUnsigned(const Int16x16& a) {
    return {vreinterpretq_s16_u16(vshrq_n_u16(vreinterpretq_u16_s16(a.low), kBits)),
            vreinterpretq_s16_u16(vshrq_n_u16(vreinterpretq_u16_s16(a.high), kBits))};
  }
  static Int16x16 even(const Int16x16& a, const Int16x16& b) {
    return {vuzp1q_s16(a.low, a.high), vuzp1q_s16(b.low, b.high)};
  }
  static Int16x16 odd(const Int16x16& a, const Int16x16& b) {
    return {vuzp2q_s16(a.low, a.high), vuzp2q_s16(b.low, b.high)};
  }
  static Int16x16 selectEqual(const Int16x16& key, std::int16_t value, const Int16x16& a, const Int16x16& b) {
    const int16x8_t wanted = vdupq_n_s16(value);
    return {vbslq_s16(vceqq_s16(key.low, wanted), a.low, b.low),
            vbslq_s16(vceqq_s16(key.high, wanted), a.high, b.high)};
  }
  static void storeBytes(std::uint8_t* to, const Int16x16& v) { vst1q_u8(to, places(v)); }
  static Places places(const Int16x16& v) { return vcombine_u8(vqmovun_s16(v.low), vqmovun_s16(v.high)); }
  static Int16x16 pick(const std::uint8_t* low, const std::uint8_t* high, const Places& place) {
    const uint8x8_t first = vqtbl1_u8(vld1q_u8(low), vget_low_u8(place));
    const uint8x8_t second = vqtbl1_u8(vld1q_u8(high), vget_high_u8(place));
    return {vreinterpretq_s16_u16(vmovl_u8(first)), vreinterpretq_s16_u16(vmovl_u8(second))};
  }

  static Float32x16 loadFloats(const float* from) {
    return {{vld1q_f32(from), vld1q_f32(from + 4), vld1q_f32(from + 8), vld1q_f32(from + 12)}};
  }
  static void storeFloats(float* to, const Float32x16& v) {
    for (int i = 0; i < 4; ++i) vst1q_f32(to + 4 * i, v.quarter[i]);
  }
  static Float32x16 broadcastFloat(float x) {
    const float32x4_t v = vdupq_n_f32(x);
    return {{v, v, v, v}};
  }
  static Float32x16 toFloats(const Int16x16& a) {
    return {{vcvtq_f32_s32(vmovl_s16(vget_low_s16(a.low))), vcvtq_f32_s32(vmovl_s16(vget_high_s16(a.low))),
             vcvtq_f32_s32(vmovl_s16(vget_low_s16(a.high))),
             vcvtq_f32_s32(vmovl_s16(vget_high_s16(a.high)))}};
  }
  static Float32x16 multiply(const Float32x16& a, const Float32x16& b) {
    Float32x16 v;
    for (int i = 0; i < 4; ++i) v.quarter[i] = vmulq_f32(a.quarter[i], b.quarter[i]);
    return v;
  }
  static Float32x16 add(const Float32x16& a, const Float32x16& b) {
    Float32x16 v;
    for (int i = 0; i < 4; ++i) v.quarter[i] = vaddq_f32(a.quarter[i], b.quarter[i]);
    return v;
  }
  static Float32x16 subtract(const Float32x16& a, const Float32x16& b) {
    Float32x16 v;
    for (int i = 0; i < 4; ++i) v.quarter[i] = vsubq_f32(a.quarter[i], b.quarter[i]);
    return v;
  }
  static Float32x16 squareRoot(const Float32x16& a) {
    Float32x16 v;
    for (int i = 0; i < 4; ++i) v.quarter[i] = vsqrtq_f32(a.quarter[i]);
    return v;
  }
  static bool anyAbove(const Float32x16& a, float limit) {
    const float32x4_t l = vdupq_n_f32(limit);
    uint32x4_t above = vdupq_n_u32(0);
    for (int i = 0; i < 4; ++i) above = vorrq_u32(above, vcgtq_f32(a.quarter[i], l));
    return vmaxvq_u32(above) != 0;
  }
  static Float32x16 multiplyAdd(const Float32x16& sum, const Float32x16& a, const Float32x16& b) {
    Float32x16 v;
    for (int i = 0; i < 4; ++i) v.quarter[i] = vfmaq_f32(sum.quarter[i], a.quarter[i], b.quarter[i]);
    return v;
  }
};

#else

using Native = Scalar;

#endif

}  // namespace swiftlet::simd
