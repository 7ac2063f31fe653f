#pragma once
// The pixel formats that are taken, by V4L2's four letters. 8 bits of grey go on from all of them.
//
// Source: linux/videodev2.h and Documentation/userspace-api/media/v4l of Linux 6.1.

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace swiftlet {

/// Where a pixel's grey lies in a row.
enum class PixelLayout : std::uint8_t {
  kBytes,      ///< a byte each; planes of chroma may follow the image
  kWords,      ///< 16 bits each, little endian
  kEvenBytes,  ///< luma, chroma
  kOddBytes,   ///< chroma, luma
  kPacked10,   ///< 4 pixels in 5 bytes: the upper 8 bits of each, then the lower 2 of all
  kPacked12,   ///< 2 pixels in 3 bytes: the upper 8 bits of each, then the lower 4 of both
  kPairs,      ///< two bytes: the left camera's pixel, the right one's
  kRgb,        ///< a byte each of red, green, blue
  kBgr,
  kRgbx,  ///< with a fourth byte that is not looked at
  kBgrx,
  kJpeg,  ///< a compressed picture
};

struct PixelFormat {
  std::array<char, 5> letters = {};  ///< blanks at the end included
  PixelLayout layout = PixelLayout::kBytes;
  std::uint8_t bits = 8;  ///< of a word or packed pixel that are used
  bool mosaic = false;    ///< of a sensor with colours behind a Bayer filter

  [[nodiscard]] constexpr std::string_view fourcc() const { return {letters.data(), 4}; }
  [[nodiscard]] constexpr bool operator==(const PixelFormat& other) const { return letters == other.letters; }
  /// Of one row without padding. JPEG: 0.
  [[nodiscard]] constexpr int rowBytes(int width) const {
    switch (layout) {
      case PixelLayout::kBytes:
        return width;
      case PixelLayout::kPacked10:  // whole groups: a lone pixel's low bits stand in the fifth byte
        return (width + 3) / 4 * 5;
      case PixelLayout::kPacked12:
        return (width + 1) / 2 * 3;
      case PixelLayout::kRgb:
      case PixelLayout::kBgr:
        return 3 * width;
      case PixelLayout::kRgbx:
      case PixelLayout::kBgrx:
        return 4 * width;
      case PixelLayout::kJpeg:
        return 0;
      default:
        return 2 * width;
    }
  }
};

inline constexpr PixelFormat kGrey8 = {{"GREY"}, PixelLayout::kBytes};

/// In the order in which an undecided user is served: grey sensors first, then the least to carry and to
/// convert; two cameras in one image and compressed pictures last.
inline constexpr std::array kPixelFormats = {
    kGrey8,
    PixelFormat{{"Y10P"}, PixelLayout::kPacked10, 10},
    PixelFormat{{"Y12P"}, PixelLayout::kPacked12, 12},
    PixelFormat{{"Y10 "}, PixelLayout::kWords, 10},
    PixelFormat{{"Y12 "}, PixelLayout::kWords, 12},
    PixelFormat{{"Y14 "}, PixelLayout::kWords, 14},
    PixelFormat{{"Y16 "}, PixelLayout::kWords, 16},
    PixelFormat{{"NV12"}, PixelLayout::kBytes},
    PixelFormat{{"NM12"}, PixelLayout::kBytes},
    PixelFormat{{"NV21"}, PixelLayout::kBytes},
    PixelFormat{{"YU12"}, PixelLayout::kBytes},
    PixelFormat{{"YM12"}, PixelLayout::kBytes},
    PixelFormat{{"YV12"}, PixelLayout::kBytes},
    PixelFormat{{"NV16"}, PixelLayout::kBytes},
    PixelFormat{{"422P"}, PixelLayout::kBytes},
    PixelFormat{{"YUYV"}, PixelLayout::kEvenBytes},
    PixelFormat{{"YVYU"}, PixelLayout::kEvenBytes},
    PixelFormat{{"UYVY"}, PixelLayout::kOddBytes},
    PixelFormat{{"VYUY"}, PixelLayout::kOddBytes},
    PixelFormat{{"BA81"}, PixelLayout::kBytes, 8, true},
    PixelFormat{{"GBRG"}, PixelLayout::kBytes, 8, true},
    PixelFormat{{"GRBG"}, PixelLayout::kBytes, 8, true},
    PixelFormat{{"RGGB"}, PixelLayout::kBytes, 8, true},
    PixelFormat{{"pBAA"}, PixelLayout::kPacked10, 10, true},
    PixelFormat{{"pGAA"}, PixelLayout::kPacked10, 10, true},
    PixelFormat{{"pgAA"}, PixelLayout::kPacked10, 10, true},
    PixelFormat{{"pRAA"}, PixelLayout::kPacked10, 10, true},
    PixelFormat{{"pBCC"}, PixelLayout::kPacked12, 12, true},
    PixelFormat{{"pGCC"}, PixelLayout::kPacked12, 12, true},
    PixelFormat{{"pgCC"}, PixelLayout::kPacked12, 12, true},
    PixelFormat{{"pRCC"}, PixelLayout::kPacked12, 12, true},
    PixelFormat{{"BG10"}, PixelLayout::kWords, 10, true},
    PixelFormat{{"GB10"}, PixelLayout::kWords, 10, true},
    PixelFormat{{"BA10"}, PixelLayout::kWords, 10, true},
    PixelFormat{{"RG10"}, PixelLayout::kWords, 10, true},
    PixelFormat{{"BG12"}, PixelLayout::kWords, 12, true},
    PixelFormat{{"GB12"}, PixelLayout::kWords, 12, true},
    PixelFormat{{"BA12"}, PixelLayout::kWords, 12, true},
    PixelFormat{{"RG12"}, PixelLayout::kWords, 12, true},
    PixelFormat{{"BYR2"}, PixelLayout::kWords, 16, true},
    PixelFormat{{"GB16"}, PixelLayout::kWords, 16, true},
    PixelFormat{{"GR16"}, PixelLayout::kWords, 16, true},
    PixelFormat{{"RG16"}, PixelLayout::kWords, 16, true},
    PixelFormat{{"RGB3"}, PixelLayout::kRgb},
    PixelFormat{{"BGR3"}, PixelLayout::kBgr},
    PixelFormat{{"AB24"}, PixelLayout::kRgbx},
    PixelFormat{{"XB24"}, PixelLayout::kRgbx},
    PixelFormat{{"AR24"}, PixelLayout::kBgrx},
    PixelFormat{{"XR24"}, PixelLayout::kBgrx},
    PixelFormat{{"Y8I "}, PixelLayout::kPairs},
    PixelFormat{{"MJPG"}, PixelLayout::kJpeg},
    PixelFormat{{"JPEG"}, PixelLayout::kJpeg},
};

/// Blanks at the end may be left out. Empty: no format that is taken (Z16, H264, ...).
[[nodiscard]] std::optional<PixelFormat> pixelFormat(std::string_view fourcc);

}  // namespace swiftlet
