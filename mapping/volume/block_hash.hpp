#pragma once
// From a block's key to its slot: open addressing with linear probing in a table of fixed size.
//
// At most half full, so that a look-up probes few entries; probing ends after kMostProbes, and an entry that
// would lie farther from its home is refused. Removing moves the followers up: no tombstones, so the table
// does not age. Not for iteration.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace swiftlet {

/// The high bits are spread evenly: Fibonacci hashing (Knuth, TAOCP 3, 6.4) after a fold that brings the high
/// coordinate down.
inline std::uint64_t mixedKey(std::uint64_t key) { return (key ^ (key >> 31U)) * 0x9E3779B97F4A7C15ULL; }

class BlockHash {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  static constexpr std::uint32_t kMostProbes = 128;

  /// For `entries` keys; 16 bytes for each of the next power of two of twice as many.
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
  /// False when there is no place within kMostProbes of the key's home. The key (never 0) is not in the
  /// table.
  [[nodiscard]] bool insert(std::uint64_t key, std::uint32_t slot);
  /// False when it was not there.
  bool erase(std::uint64_t key);
  void clear();

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t bytes() const { return table_.size() * sizeof(Entry); }
  /// What a table for `entries` keys takes.
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
