#include "drivers/image/pixel_format.hpp"

namespace swiftlet {

std::optional<PixelFormat> pixelFormat(std::string_view name) {
  for (const PixelFormat& format : kPixelFormats) {
    const std::string_view letters = format.fourcc();
    if (name == letters || name == letters.substr(0, letters.find(' '))) return format;
  }
  return std::nullopt;
}

}  // namespace swiftlet
