#pragma once
// Marks the blocks around the camera that an image has already met: one bit each in a cube of fixed size.

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "mapping/volume/block_index.hpp"

namespace swiftlet {

class BlockWindow {
 public:
  /// Extends `reach` blocks from the centre in every direction.
  explicit BlockWindow(int reach)
      : side_(static_cast<int>(std::bit_ceil(static_cast<unsigned>(2 * std::max(reach, 1) + 2)))),
        bits_(std::countr_zero(static_cast<unsigned>(side_))),
        met_((std::size_t{1} << (3 * bits_)) / 64 + 1) {}

  void clear() { std::fill(met_.begin(), met_.end(), 0); }
  /// `from_centre` in blocks. False if the block was met before or is outside the window.
  bool meet(const BlockIndex& from_centre) {
    const auto half = side_ / 2;
    const auto x = static_cast<unsigned>(from_centre.x + half),
               y = static_cast<unsigned>(from_centre.y + half),
               z = static_cast<unsigned>(from_centre.z + half);
    if ((x | y | z) >= static_cast<unsigned>(side_)) return false;
    const std::size_t at =
        x + (static_cast<std::size_t>(y) << bits_) + (static_cast<std::size_t>(z) << (2 * bits_));
    const std::uint64_t bit = std::uint64_t{1} << (at & 63U);
    if ((met_[at >> 6U] & bit) != 0) return false;
    met_[at >> 6U] |= bit;
    return true;
  }
  [[nodiscard]] std::size_t bytes() const { return met_.size() * sizeof(std::uint64_t); }

 private:
  int side_;
  int bits_;
  std::vector<std::uint64_t> met_;
};

}  // namespace swiftlet
