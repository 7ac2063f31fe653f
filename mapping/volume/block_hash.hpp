#pragma once
// Hash table from a block's key to its slot: open addressing with linear probing, fixed size.
//
// The table is at most half full, so that a look-up probes few entries. Probing ends after kMostProbes, and
// an entry that would be farther from its home is refused. Removal moves the following entries up instead of
// leaving tombstones, so look-ups do not become slower over time. Not for iteration.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace swiftlet {

/// Fibonacci hashing (Knuth, TAOCP 3, 6.4), whose high bits are evenly spread, after folding the high
/// coordinate into the low bits.
inline std::uint64_t mixedKey(std::uint64_t key) { return (key ^ (key >> 31U)) * 0x9E3779B97F4A7C15ULL; }

class BlockHash {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  static constexpr std::uint32_t kMostProbes = 128;

  /// For `entries` keys. Memory: 16 bytes times twice as many, rounded up to a power of two.
  explicit BlockHash(std::size_t entries);

  [[nodiscard]] std::uint32_t find(std::uint64_t key) const {
    std::size_t at = home(key);
    for (std::uint32_t probe = 0; probe < kMostProbes; ++probe) {
      const Entry& entry = table_[at];
      if (entry.key == key) return entry.slot;
      if (entry.key == 0) return kNone;
      at = (at + 1) & mask_;
    }
    return kNone;
  }
  /// False if there is no free entry within kMostProbes of the key's home. The key must not be 0 nor in the
  /// table.
  [[nodiscard]] bool insert(std::uint64_t key, std::uint32_t slot);
  /// False if the key is not in the table.
  bool erase(std::uint64_t key);
  void clear();

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t bytes() const { return table_.size() * sizeof(Entry); }
  /// Memory of a table for `entries` keys.
  static std::size_t bytesFor(std::size_t entries);

 private:
  struct Entry {
    std::uint64_t key = 0;  ///< 0: free
    std::uint32_t slot = kNone;
  };

  [[nodiscard]] std::size_t home(std::uint64_t key) const {
    return static_cast<std::size_t>(mixedKey(key) >> shift_);
  }

  std::vector<Entry> table_;
  std::size_t mask_ = 0;
  std::uint32_t shift_ = 0;
  std::size_t size_ = 0;
};

}  // namespace swiftlet
