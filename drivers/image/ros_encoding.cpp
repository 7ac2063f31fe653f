#include "drivers/image/ros_encoding.hpp"

#include <algorithm>
#include <array>

namespace swiftlet {
namespace {

struct Pair {
  std::string_view name;
  std::string_view letters;
};

constexpr std::array kPairs = {
    Pair{"mono8", "GREY"},        Pair{"8UC1", "GREY"},         Pair{"mono16", "Y16 "},
    Pair{"16UC1", "Y16 "},        Pair{"rgb8", "RGB3"},         Pair{"bgr8", "BGR3"},
    Pair{"8UC3", "BGR3"},         Pair{"rgba8", "AB24"},        Pair{"bgra8", "AR24"},
    Pair{"8UC4", "AR24"},         Pair{"yuv422", "UYVY"},       Pair{"uyvy", "UYVY"},
    Pair{"yuv422_yuy2", "YUYV"},  Pair{"yuyv", "YUYV"},         Pair{"nv12", "NV12"},
    Pair{"nv21", "NV21"},         Pair{"bayer_rggb8", "RGGB"},  Pair{"bayer_bggr8", "BA81"},
    Pair{"bayer_gbrg8", "GBRG"},  Pair{"bayer_grbg8", "GRBG"},  Pair{"bayer_rggb16", "RG16"},
    Pair{"bayer_bggr16", "BYR2"}, Pair{"bayer_gbrg16", "GB16"}, Pair{"bayer_grbg16", "GR16"},
};

}  // namespace

std::optional<PixelFormat> rosEncoding(std::string_view name, bool big_endian) {
  const auto* pair = std::ranges::find(kPairs, name, &Pair::name);
  if (pair == kPairs.end()) return std::nullopt;
  std::optional<PixelFormat> format = pixelFormat(pair->letters);
  // All 16 bits are used, so the upper 8, the only ones needed, are the first byte.
  if (big_endian && format->layout == PixelLayout::kWords) format->layout = PixelLayout::kEvenBytes;
  return format;
}

}  // namespace swiftlet
