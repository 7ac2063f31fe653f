#pragma once
// Which loops agree with each other: a symmetric matrix of bits, one row of 64-bit words per loop.
// A new loop adds a row and a column in time linear in the loops. Memory: capacity^2 / 8 bytes, reserved by
// the constructor (0.5 MiB for 2048 loops); no allocation afterwards.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace swiftlet {

/// A set of small numbers as bits; all sets of one graph have the same number of words.
using BitSet = std::span<std::uint64_t>;
using ConstBitSet = std::span<const std::uint64_t>;

inline constexpr std::uint32_t kBitsPerWord = 64;

inline std::uint32_t wordsFor(std::uint32_t bits) { return (bits + kBitsPerWord - 1) / kBitsPerWord; }
inline void setBit(BitSet set, std::uint32_t k) { set[k / kBitsPerWord] |= 1ULL << (k % kBitsPerWord); }
inline void clearBit(BitSet set, std::uint32_t k) { set[k / kBitsPerWord] &= ~(1ULL << (k % kBitsPerWord)); }
inline bool testBit(ConstBitSet set, std::uint32_t k) {
  return ((set[k / kBitsPerWord] >> (k % kBitsPerWord)) & 1U) != 0;
}
inline std::uint32_t countBits(ConstBitSet set) {
  std::uint32_t count = 0;
  for (const std::uint64_t word : set) {
    count += static_cast<std::uint32_t>(std::popcount(word));
  }
  return count;
}
/// Numbers in both sets.
inline std::uint32_t countBoth(ConstBitSet a, ConstBitSet b) {
  std::uint32_t count = 0;
  for (std::size_t w = 0; w < a.size(); ++w) {
    count += static_cast<std::uint32_t>(std::popcount(a[w] & b[w]));
  }
  return count;
}
/// Calls visit(k) for the numbers of the set, ascending.
template <typename Visit>
void forEachBit(ConstBitSet set, Visit&& visit) {
  for (std::size_t w = 0; w < set.size(); ++w) {
    for (std::uint64_t word = set[w]; word != 0; word &= word - 1) {
      visit(static_cast<std::uint32_t>(w * kBitsPerWord) +
            static_cast<std::uint32_t>(std::countr_zero(word)));
    }
  }
}

class ConsistencyGraph {
 public:
  explicit ConsistencyGraph(std::uint32_t capacity)
      : capacity_(capacity), words_(wordsFor(capacity)), bits_(std::size_t{capacity} * words_, 0) {}

  [[nodiscard]] std::uint32_t capacity() const { return capacity_; }
  /// Words of a row.
  [[nodiscard]] std::uint32_t words() const { return words_; }
  [[nodiscard]] ConstBitSet row(std::uint32_t k) const {
    return {bits_.data() + std::size_t{k} * words_, words_};
  }
  [[nodiscard]] bool consistent(std::uint32_t a, std::uint32_t b) const { return testBit(row(a), b); }
  void connect(std::uint32_t a, std::uint32_t b) {
    setBit(mutableRow(a), b);
    setBit(mutableRow(b), a);
  }
  /// Clears the loop's row and column.
  void disconnect(std::uint32_t k) {
    forEachBit(row(k), [&](std::uint32_t other) { clearBit(mutableRow(other), k); });
    for (std::uint64_t& word : mutableRow(k)) {
      word = 0;
    }
  }
  void clear() { bits_.assign(bits_.size(), 0); }

 private:
  [[nodiscard]] BitSet mutableRow(std::uint32_t k) {
    return {bits_.data() + std::size_t{k} * words_, words_};
  }

  std::uint32_t capacity_;
  std::uint32_t words_;
  std::vector<std::uint64_t> bits_;
};

}  // namespace swiftlet
