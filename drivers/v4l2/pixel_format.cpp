#include "drivers/v4l2/pixel_format.hpp"

namespace swiftlet {

std::string_view fourcc(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGrey:
      return "GREY";
    case PixelFormat::kY10:
      return "Y10 ";
    case PixelFormat::kY16:
      return "Y16 ";
    case PixelFormat::kYuyv:
      return "YUYV";
    case PixelFormat::kUyvy:
      return "UYVY";
  }
  return {};
}

std::optional<PixelFormat> pixelFormat(std::string_view name) {
  for (const PixelFormat format : kPixelFormats) {
    const std::string_view letters = fourcc(format);
    if (name == letters || (name.size() == 3 && letters[3] == ' ' && name == letters.substr(0, 3))) {
      return format;
    }
  }
  return std::nullopt;
}

}  // namespace swiftlet
