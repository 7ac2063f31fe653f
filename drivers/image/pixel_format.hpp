#pragma once
// The supported pixel formats, by V4L2's four letters. All are converted to 8-bit grey.
//
// Source: linux/videodev2.h and Documentation/userspace-api/media/v4l of Linux 6.1.

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace swiftlet {

/// Position of a pixel's grey value in a row.
enum class PixelLayout : std::uint8_t {
  kBytes,      ///< one byte per pixel; chroma planes may follow the image
  kWords,      ///< 16 bits per pixel, little endian
  kEvenBytes,  ///< luma in even bytes, chroma in odd ones
  kOddBytes,   ///< chroma in even bytes, luma in odd ones
  kPacked10,   ///< 4 pixels in 5 bytes: the upper 8 bits of each, then the lower 2 of all
  kPacked12,   ///< 2 pixels in 3 bytes: the upper 8 bits of each, then the lower 4 of both
  kPairs,      ///< two bytes: pixel of the left camera, pixel of the right camera
  kRgb,        ///< one byte each of red, green, blue
  kBgr,
  kRgbx,  ///< with a fourth byte that is ignored
  kBgrx,
  kJpeg,  ///< a compressed picture
};

struct PixelFormat {
  std::array<char, 5> letters = {};  ///< including trailing blanks
  PixelLayout layout = PixelLayout::kBytes;
  std::uint8_t bits = 8;  ///< used bits of a word or packed pixel
  bool mosaic = false;    ///< the sensor has a Bayer filter

  [[nodiscard]] constexpr std::string_view fourcc() const { return {letters.data(), 4}; }
  [[nodiscard]] constexpr bool operator==(const PixelFormat& other) const { return letters == other.letters; }
  /// Bytes of one row without padding. JPEG: 0.
  [[nodiscard]] constexpr int rowBytes(int width) const {
    switch (layout) {
      case PixelLayout::kBytes:
        return width;
      case PixelLayout::kPacked10:  // whole groups: the low bits of even one pixel are in the fifth byte
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

/// In order of preference: grey sensors first, then the least data and conversion; two cameras in one image
/// and compressed images last.
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

/// Trailing blanks may be omitted. Empty: an unsupported format (Z16, H264, ...).
[[nodiscard]] std::optional<PixelFormat> pixelFormat(std::string_view fourcc);

}  // namespace swiftlet
