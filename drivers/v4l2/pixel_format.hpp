#pragma once
// The pixel formats that a camera may send: uncompressed ones with luma on its own. 8 bits go on from all of
// them.

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace swiftlet {

enum class PixelFormat : std::uint8_t {
  kGrey,  ///< 8 bits
  kY10,   ///< 10 bits in the low bits of 16, little endian
  kY16,   ///< 16 bits, little endian
  kYuyv,  ///< luma in the even bytes
  kUyvy,  ///< luma in the odd bytes
};

/// In the order in which an undecided user is served: the least to carry and to convert first.
inline constexpr std::array kPixelFormats = {PixelFormat::kGrey, PixelFormat::kY10, PixelFormat::kY16,
                                             PixelFormat::kYuyv, PixelFormat::kUyvy};

[[nodiscard]] constexpr int bytesPerPixel(PixelFormat format) { return format == PixelFormat::kGrey ? 1 : 2; }

/// The kernel's four letters: "GREY", "Y10 ", "Y16 ", "YUYV", "UYVY".
[[nodiscard]] std::string_view fourcc(PixelFormat format);
/// Blanks at the end may be left out. Empty: no format that is taken (MJPG, NV12, ...).
[[nodiscard]] std::optional<PixelFormat> pixelFormat(std::string_view fourcc);

}  // namespace swiftlet
