#pragma once
// A borrowed image as the camera sent it. GreyReader makes grey of it.

#include <array>
#include <cstddef>
#include <cstdint>

#include "drivers/image/pixel_format.hpp"

namespace swiftlet {

struct RawImage {
  const std::uint8_t* data = nullptr;
  int width = 0;   ///< pixels
  int height = 0;  ///< pixels
  int stride = 0;  ///< bytes from row to row, >= format.rowBytes(left + width)
  PixelFormat format = kGrey8;
  int left = 0;           ///< pixels of each row before the first that belongs to the image
  std::size_t bytes = 0;  ///< of a compressed picture

  [[nodiscard]] bool empty() const { return data == nullptr || width <= 0 || height <= 0; }
  [[nodiscard]] const std::uint8_t* row(int y) const {
    return data + static_cast<std::ptrdiff_t>(y) * stride;
  }
};

/// The left and the right half of columns of an uncompressed image. An odd width's last column belongs to
/// neither.
[[nodiscard]] std::array<RawImage, 2> sideBySide(const RawImage& image);

/// A row's pixels, `width` bytes: the upper 8 bits of each, of words those above `shift`. Luma keeps its
/// range, 16 to 235 as a rule. Not for compressed pictures.
void unpackRow(const RawImage& image, int y, unsigned shift, std::uint8_t* out);

}  // namespace swiftlet
