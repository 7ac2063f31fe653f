#pragma once
// A borrowed image as the camera sent it, and its way to 8-bit grey: one pass, straight into where it is to
// lie.

#include <array>
#include <cstddef>
#include <cstdint>

#include "drivers/v4l2/pixel_format.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

struct RawImage {
  const std::uint8_t* data = nullptr;
  int width = 0;   ///< pixels
  int height = 0;  ///< pixels
  int stride = 0;  ///< bytes from row to row, >= width * bytesPerPixel(format)
  PixelFormat format = PixelFormat::kGrey;

  [[nodiscard]] bool empty() const { return data == nullptr || width <= 0 || height <= 0; }
  [[nodiscard]] const std::uint8_t* row(int y) const {
    return data + static_cast<std::ptrdiff_t>(y) * stride;
  }
};

/// A part of the same bytes; what lies outside is cut off. An odd `x` of YUYV and UYVY is right too: only
/// luma is read.
[[nodiscard]] RawImage crop(const RawImage& image, int x, int y, int width, int height);

/// Two cameras in one image: the left and the right half. An odd width's last column belongs to neither.
[[nodiscard]] std::array<RawImage, 2> sideBySide(const RawImage& image);

/// 8-bit grey: GREY as it is; Y10 and Y16 their upper 8 bits (a Y10 pixel above 1023 is white); YUYV and UYVY
/// their luma, whose range (16 to 235 as a rule) is not stretched. `out` holds `height` rows, `out_stride`
/// bytes apart. One load and one store a pixel, vectorized by the compiler.
void toGrey(const RawImage& image, std::uint8_t* out, int out_stride);

/// The image itself where it is GREY; empty otherwise.
[[nodiscard]] ImageView greyView(const RawImage& image);

}  // namespace swiftlet
