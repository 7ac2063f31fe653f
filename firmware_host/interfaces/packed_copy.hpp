#pragma once
// An image copied row by row into memory without padding.

#include <algorithm>
#include <cstdint>

#include "estimator/core/image_view.hpp"

namespace swiftlet {

/// `to` has width * height bytes. Returns a view of the copy; empty if `from` is empty.
inline ImageView packedCopy(const ImageView& from, std::uint8_t* to) {
  if (from.empty()) return {};
  for (int y = 0; y < from.height; ++y)
    std::copy_n(from.row(y), from.width, to + std::ptrdiff_t{y} * from.width);
  return {to, from.width, from.height, from.width};
}

}  // namespace swiftlet
