#include "drivers/v4l2/raw_image.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace swiftlet {
namespace {

static_assert(std::endian::native == std::endian::little, "16-bit pixels are read as the machine's own");

constexpr unsigned kWhite = 255;

void rowOf10(const std::uint8_t* in, std::uint8_t* out, int width) {
  for (int x = 0; x < width; ++x) {
    std::uint16_t pixel = 0;
    std::memcpy(&pixel, in + 2 * x, sizeof(pixel));
    out[x] = static_cast<std::uint8_t>(std::min<unsigned>(pixel >> 2U, kWhite));
  }
}

// The upper half of 16 little-endian bits, UYVY's luma: the odd bytes. YUYV's: the even ones.
template <int kOffset>
void rowOfEverySecondByte(const std::uint8_t* in, std::uint8_t* out, int width) {
  for (int x = 0; x < width; ++x) out[x] = in[2 * x + kOffset];
}

}  // namespace

RawImage crop(const RawImage& image, int x, int y, int width, int height) {
  RawImage part = image;
  const int left = std::clamp(x, 0, image.width);
  const int top = std::clamp(y, 0, image.height);
  part.width = std::clamp(width, 0, image.width - left);
  part.height = std::clamp(height, 0, image.height - top);
  part.data = image.row(top) + static_cast<std::ptrdiff_t>(left) * bytesPerPixel(image.format);
  return part;
}

std::array<RawImage, 2> sideBySide(const RawImage& image) {
  const int half = image.width / 2;
  return {crop(image, 0, 0, half, image.height), crop(image, half, 0, half, image.height)};
}

void toGrey(const RawImage& image, std::uint8_t* out, int out_stride) {
  for (int y = 0; y < image.height; ++y, out += out_stride) {
    const std::uint8_t* in = image.row(y);
    switch (image.format) {
      case PixelFormat::kGrey:
        std::memcpy(out, in, static_cast<std::size_t>(image.width));
        break;
      case PixelFormat::kY10:
        rowOf10(in, out, image.width);
        break;
      case PixelFormat::kY16:
      case PixelFormat::kUyvy:
        rowOfEverySecondByte<1>(in, out, image.width);
        break;
      case PixelFormat::kYuyv:
        rowOfEverySecondByte<0>(in, out, image.width);
        break;
    }
  }
}

ImageView greyView(const RawImage& image) {
  if (image.format != PixelFormat::kGrey) return {};
  return {image.data, image.width, image.height, image.stride};
}

}  // namespace swiftlet
