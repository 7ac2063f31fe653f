#pragma once
// Vectors of unsigned bytes for the corner kernel: the compiler's vector extensions (GCC, Clang: AVX2, SSE2,
// NEON) and a scalar version that defines the result. All operations are exact.

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "estimator/core/simd.hpp"

namespace swiftlet::byte_lanes {

struct Scalar {
  static constexpr int kWidth = 16;
  using Bytes = std::array<std::uint8_t, kWidth>;
  using Isa = simd::Scalar;  ///< for 16-bit lanes

  static Bytes load(const std::uint8_t* from) {
    Bytes v;
    for (std::size_t i = 0; i < kWidth; ++i) v[i] = from[i];
    return v;
  }
  static void store(std::uint8_t* to, const Bytes& v) {
    for (std::size_t i = 0; i < kWidth; ++i) to[i] = v[i];
  }
  static Bytes zero() { return {}; }
  static Bytes broadcast(std::uint8_t x) {
    Bytes v;
    v.fill(x);
    return v;
  }
  static Bytes min(const Bytes& a, const Bytes& b) {
    Bytes v;
    for (std::size_t i = 0; i < kWidth; ++i) v[i] = a[i] < b[i] ? a[i] : b[i];
    return v;
  }
  static Bytes max(const Bytes& a, const Bytes& b) {
    Bytes v;
    for (std::size_t i = 0; i < kWidth; ++i) v[i] = a[i] > b[i] ? a[i] : b[i];
    return v;
  }
  /// max(a - b, 0)
  static Bytes above(const Bytes& a, const Bytes& b) {
    Bytes v;
    for (std::size_t i = 0; i < kWidth; ++i) v[i] = static_cast<std::uint8_t>(a[i] > b[i] ? a[i] - b[i] : 0);
    return v;
  }
  static bool anyAbove(const Bytes& a, std::uint8_t limit) {
    for (const std::uint8_t x : a) {
      if (x > limit) return true;
    }
    return false;
  }
};

#if defined(__AVX2__)
inline constexpr int kNativeWidth = 32;
#else
inline constexpr int kNativeWidth = 16;
#endif

struct Native {
  static constexpr int kWidth = kNativeWidth;
  using Bytes [[gnu::vector_size(kNativeWidth)]] = std::uint8_t;
  using Isa = simd::Native;

  static Bytes load(const std::uint8_t* from) {
    Bytes v;
    std::memcpy(&v, from, sizeof v);
    return v;
  }
  static void store(std::uint8_t* to, const Bytes& v) { std::memcpy(to, &v, sizeof v); }
  static Bytes zero() { return Bytes{}; }
  static Bytes broadcast(std::uint8_t x) { return Bytes{} + x; }
  static Bytes min(const Bytes& a, const Bytes& b) { return a < b ? a : b; }
  static Bytes max(const Bytes& a, const Bytes& b) { return a > b ? a : b; }
  static Bytes above(const Bytes& a, const Bytes& b) { return max(a, b) - b; }
  static bool anyAbove(const Bytes& a, std::uint8_t limit) {
    const Bytes over = above(a, Bytes{} + limit);
    std::array<std::uint64_t, kWidth / 8> words;
    std::memcpy(words.data(), &over, sizeof over);
    std::uint64_t any = 0;
    for (const std::uint64_t w : words) any |= w;
    return any != 0;
  }
};

}  // namespace swiftlet::byte_lanes
