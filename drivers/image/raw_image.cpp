#include "drivers/image/raw_image.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace swiftlet {
namespace {

static_assert(std::endian::native == std::endian::little, "16-bit pixels are read as the machine's own");

constexpr unsigned kWhite = 255;

void words(const std::uint8_t* in, unsigned shift, int width, std::uint8_t* out) {
  for (int x = 0; x < width; ++x) {
    std::uint16_t pixel = 0;
    std::memcpy(&pixel, in + 2 * x, sizeof(pixel));
    out[x] = static_cast<std::uint8_t>(std::min<unsigned>(static_cast<unsigned>(pixel) >> shift, kWhite));
  }
}

void everySecondByte(const std::uint8_t* in, int width, std::uint8_t* out) {
  for (int x = 0; x < width; ++x) out[x] = in[2 * x];
}

/// Copies the bytes of a row except every (kGroup + 1)th, which has the low bits.
template <int kGroup>
void packed(const std::uint8_t* row, int left, int width, std::uint8_t* out) {
  int x = left;
  const int end = left + width;
  for (; x < end && x % kGroup != 0; ++x) *out++ = row[x + x / kGroup];
  const std::uint8_t* in = row + x + x / kGroup;
  for (; x + kGroup <= end; x += kGroup, in += kGroup + 1, out += kGroup) std::memcpy(out, in, kGroup);
  for (; x < end; ++x) *out++ = *in++;
}

/// Luma by ITU-R BT.601, in 14 bits, rounded half up. Pixels of kBytes bytes, red at byte kRed.
template <int kBytes, int kRed>
void colours(const std::uint8_t* in, int width, std::uint8_t* out) {
  constexpr unsigned kShift = 14;
  constexpr unsigned kRedWeight = 4899;
  constexpr unsigned kGreenWeight = 9617;
  constexpr unsigned kBlueWeight = 1868;
  for (int x = 0; x < width; ++x, in += kBytes) {
    const unsigned sum = kRedWeight * in[kRed] + kGreenWeight * in[1] + kBlueWeight * in[2 - kRed];
    out[x] = static_cast<std::uint8_t>((sum + (1U << (kShift - 1U))) >> kShift);
  }
}

}  // namespace

std::array<RawImage, 2> sideBySide(const RawImage& image) {
  std::array<RawImage, 2> halves = {image, image};
  for (RawImage& half : halves) half.width = image.width / 2;
  halves[1].left += halves[0].width;
  return halves;
}

void unpackRow(const RawImage& image, int y, unsigned shift, std::uint8_t* out) {
  const std::uint8_t* row = image.row(y);
  const int left = image.left;
  switch (image.format.layout) {
    case PixelLayout::kBytes:
      std::memcpy(out, row + left, static_cast<std::size_t>(image.width));
      break;
    case PixelLayout::kWords:
      words(row + 2 * left, shift, image.width, out);
      break;
    case PixelLayout::kEvenBytes:
      everySecondByte(row + 2 * left, image.width, out);
      break;
    case PixelLayout::kOddBytes:
      everySecondByte(row + 2 * left + 1, image.width, out);
      break;
    case PixelLayout::kPacked10:
      packed<4>(row, left, image.width, out);
      break;
    case PixelLayout::kPacked12:
      packed<2>(row, left, image.width, out);
      break;
    case PixelLayout::kRgb:
      colours<3, 0>(row + 3 * left, image.width, out);
      break;
    case PixelLayout::kBgr:
      colours<3, 2>(row + 3 * left, image.width, out);
      break;
    case PixelLayout::kRgbx:
      colours<4, 0>(row + 4 * left, image.width, out);
      break;
    case PixelLayout::kBgrx:
      colours<4, 2>(row + 4 * left, image.width, out);
      break;
    case PixelLayout::kPairs:  // GreyReader separates them
    case PixelLayout::kJpeg:
      break;
  }
}

}  // namespace swiftlet
