#include "mapping/volume/block_hash.hpp"

#include <algorithm>
#include <bit>

namespace swiftlet {
namespace {

std::size_t tableSize(std::size_t entries) { return std::bit_ceil(std::max<std::size_t>(2 * entries, 16)); }

}  // namespace

BlockHash::BlockHash(std::size_t entries)
    : table_(tableSize(entries)),
      mask_(table_.size() - 1),
      shift_(64U - static_cast<std::uint32_t>(std::countr_zero(table_.size()))) {}

std::size_t BlockHash::bytesFor(std::size_t entries) { return tableSize(entries) * sizeof(Entry); }

bool BlockHash::insert(std::uint64_t key, std::uint32_t slot) {
  std::size_t at = home(key);
  for (std::uint32_t probe = 0; probe < kMostProbes; ++probe) {
    if (table_[at].key == 0) {
      table_[at] = {key, slot};
      ++size_;
      return true;
    }
    at = (at + 1) & mask_;
  }
  return false;
}

bool BlockHash::erase(std::uint64_t key) {
  std::size_t at = home(key);
  for (std::uint32_t probe = 0; table_[at].key != key; ++probe) {
    if (table_[at].key == 0 || probe == kMostProbes) return false;
    at = (at + 1) & mask_;
  }
  // Followers whose home lies at or before the gap move into it (Knuth, TAOCP 3, 6.4, algorithm R).
  std::size_t gap = at;
  for (std::size_t next = (gap + 1) & mask_; table_[next].key != 0; next = (next + 1) & mask_) {
    const std::size_t from_home = (next - home(table_[next].key)) & mask_;
    if (from_home >= ((next - gap) & mask_)) {
      table_[gap] = table_[next];
      gap = next;
    }
  }
  table_[gap] = {};
  --size_;
  return true;
}

void BlockHash::clear() {
  std::fill(table_.begin(), table_.end(), Entry{});
  size_ = 0;
}

}  // namespace swiftlet
