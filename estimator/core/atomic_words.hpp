#pragma once
// A trivially copyable value stored as atomic 64-bit words, so that one thread may overwrite it while another
// reads it without a data race in the sense of the C++ memory model. A value read during an overwrite is a
// mixture of words; the carrier detects and discards it (H.-J. Boehm, "Can seqlocks get along with
// programming language memory models?", MSPC 2012).
//
// Memory: sizeof(T) rounded up to 8 bytes. Cost: one plain load or store per word on x86-64; on aarch64
// release and acquire words are stlr and ldar, which keep their order.

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "estimator/core/atomic_policy.hpp"

namespace swiftlet {

template <typename T, typename Policy = HardwareAtomics>
class AtomicWords {
  static_assert(std::is_trivially_copyable_v<T> && std::is_default_constructible_v<T>,
                "a value that is copied word by word; Eigen's types are not: give them to Newest");

 public:
  void store(const T& value, std::memory_order order) {
    std::array<std::uint64_t, kWords> raw{};
    std::memcpy(raw.data(), &value, sizeof(T));
    for (std::size_t i = 0; i < kWords; ++i) words_[i].store(raw[i], order);
  }

  [[nodiscard]] T load(std::memory_order order) const {
    std::array<std::uint64_t, kWords> raw;
    for (std::size_t i = 0; i < kWords; ++i) raw[i] = words_[i].load(order);
    T value;
    std::memcpy(static_cast<void*>(&value), raw.data(), sizeof(T));
    return value;
  }

 private:
  static constexpr std::size_t kWords = (sizeof(T) + 7) / 8;
  std::array<typename Policy::template Atomic<std::uint64_t>, kWords> words_{};
};

}  // namespace swiftlet
