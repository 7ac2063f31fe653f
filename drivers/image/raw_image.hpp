#pragma once
// A borrowed image as the camera sent it; GreyReader converts it to grey.

#include <array>
#include <cstddef>
#include <cstdint>

#include "drivers/image/pixel_format.hpp"

namespace swiftlet {

struct RawImage {
  const std::uint8_t* data = nullptr;
  int width = 0;   ///< pixels
  int height = 0;  ///< pixels
  int stride = 0;  ///< bytes per row, >= format.rowBytes(left + width)
  PixelFormat format = kGrey8;
  int left = 0;           ///< pixels of each row before the image's first column
  std::size_t bytes = 0;  ///< of a compressed image

  [[nodiscard]] bool empty() const { return data == nullptr || width <= 0 || height <= 0; }
  [[nodiscard]] const std::uint8_t* row(int y) const {
    return data + static_cast<std::ptrdiff_t>(y) * stride;
  }
};

/// The left and the right half of an uncompressed image. The last column of an odd width belongs to neither.
[[nodiscard]] std::array<RawImage, 2> sideBySide(const RawImage& image);

/// Unpacks the pixels of a row to `width` bytes: the upper 8 bits of each; for words, the 8 bits above
/// `shift`. Luma keeps its range, usually 16 to 235. Not for compressed images.
void unpackRow(const RawImage& image, int y, unsigned shift, std::uint8_t* out);

}  // namespace swiftlet
