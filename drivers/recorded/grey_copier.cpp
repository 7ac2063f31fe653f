#include "drivers/recorded/grey_copier.hpp"

#include <cstring>
#include <optional>

#include "drivers/image/ros_encoding.hpp"

namespace swiftlet {

DecodeResult GreyCopier::copy(const rosmsg::Image& image, ImageSize expected, std::uint8_t* out,
                              ImageSize& found) {
  if (image.width > kMaxImageSide || image.height > kMaxImageSide) return DecodeResult::kDamaged;
  found = {static_cast<int>(image.width), static_cast<int>(image.height)};
  const std::optional<PixelFormat> format = rosEncoding(image.encoding, image.is_bigendian != 0);
  if (!format) return DecodeResult::kUnknownFormat;
  if (found != expected) return DecodeResult::kWrongSize;
  const auto width = static_cast<std::size_t>(expected.width);
  const auto height = static_cast<std::size_t>(expected.height);
  const auto row = static_cast<std::size_t>(format->rowBytes(expected.width));
  if (width == 0 || height == 0 || image.step < row || image.data.size() < image.step * (height - 1) + row)
    return DecodeResult::kDamaged;
  if (*format != format_ || expected != size_) {
    format_ = *format;
    size_ = expected;
    reader_.reserve(format_, size_.width, size_.height, false);
  }
  RawImage raw;
  raw.data = image.data.data();
  raw.width = expected.width;
  raw.height = expected.height;
  raw.stride = static_cast<int>(image.step);
  raw.format = *format;
  const ImageView grey = reader_.read(raw)[0];
  for (int y = 0; y < grey.height; ++y) {
    std::memcpy(out + static_cast<std::size_t>(y) * width, grey.row(y), width);
  }
  return DecodeResult::kOk;
}

}  // namespace swiftlet
