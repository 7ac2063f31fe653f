#pragma once
// A view of an 8-bit grey image: row-major, `stride` bytes per row. Does not own the pixels.

#include <cstddef>
#include <cstdint>

namespace swiftlet {

struct ImageView {
  const std::uint8_t* data = nullptr;
  int width = 0;   ///< pixels
  int height = 0;  ///< pixels
  int stride = 0;  ///< bytes, >= width

  [[nodiscard]] bool empty() const { return data == nullptr || width <= 0 || height <= 0; }
  [[nodiscard]] const std::uint8_t* row(int y) const {
    return data + static_cast<std::ptrdiff_t>(y) * stride;
  }
};

}  // namespace swiftlet
