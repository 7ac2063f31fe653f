#pragma once
// Vectors of eight numbers by the vector extensions of GCC and Clang: the same arithmetic and rounding per
// lane on AVX2 and on NEON (two registers there).

#include <array>
#include <cstdint>
#include <cstring>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace swiftlet::lanes {

inline constexpr std::size_t kLanes = 8;

using Floats = float __attribute__((vector_size(32)));
using Ints = std::int32_t __attribute__((vector_size(32)));
using Shorts = std::int16_t __attribute__((vector_size(16)));
using UnsignedShorts = std::uint16_t __attribute__((vector_size(16)));

template <typename Vector, typename Value>
inline void load(Vector& to, const Value* from) {
  std::memcpy(&to, from, sizeof(to));
}
template <typename Vector, typename Value>
inline void store(Value* to, const Vector& from) {
  std::memcpy(to, &from, sizeof(from));
}

/// from[at[i]] for every lane.
inline void gather(Floats& to, const float* from, const Ints& at) {
#if defined(__AVX2__)
  to = reinterpret_cast<Floats>(_mm256_i32gather_ps(from, reinterpret_cast<__m256i>(at), 4));
#else
  for (std::size_t i = 0; i < kLanes; ++i) to[i] = from[at[i]];
#endif
}

/// Lanes of a comparison are 0 or -1.
inline bool any(const Ints& mask) {
  std::array<std::uint64_t, 4> words;
  std::memcpy(words.data(), &mask, sizeof(mask));
  return (words[0] | words[1] | words[2] | words[3]) != 0;
}

/// Bit i of a comparison's lane i.
inline std::uint32_t bits(const Shorts& mask) {
  const Shorts own = mask & Shorts{1, 2, 4, 8, 16, 32, 64, 128};
  std::array<std::uint64_t, 2> words;
  std::memcpy(words.data(), &own, sizeof(own));
  std::uint64_t all = words[0] | words[1];
  all |= all >> 32U;
  all |= all >> 16U;
  return static_cast<std::uint32_t>(all & 0xFFU);
}

inline float largest(const Floats& v) {
  float most = v[0];
  for (std::size_t i = 1; i < kLanes; ++i) most = v[i] > most ? v[i] : most;
  return most;
}

inline std::int32_t sum(const Ints& v) {
  std::int32_t total = 0;
  for (std::size_t i = 0; i < kLanes; ++i) total += v[i];
  return total;
}

}  // namespace swiftlet::lanes
