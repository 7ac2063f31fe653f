#include "firmware_host/inputs/devices/image_watch.hpp"

namespace swiftlet {
namespace {

/// Mean grey value; the same as in the front-end, which treats darker images as missing.
constexpr std::uint64_t kDarkMean = 12;
// Constants of FNV-1a.
constexpr std::uint64_t kStart = 0xcbf29ce484222325;
constexpr std::uint64_t kFactor = 0x100000001b3;

}  // namespace

ImageWatch::Look ImageWatch::look(const ImageView& image) {
  std::uint64_t signature = kStart;
  std::uint64_t sum = 0;
  std::uint64_t pixels = 0;
  for (int y = 0; y < image.height; y += kRowStep) {
    const std::uint8_t* row = image.row(y);
    for (int x = 0; x < image.width; ++x) {
      const std::uint8_t grey = row[x];
      signature = (signature ^ grey) * kFactor;
      sum += grey;
    }
    pixels += static_cast<std::uint64_t>(image.width);
  }
  const bool repeated = signature == signature_;
  signature_ = signature;
  if (sum <= kDarkMean * pixels) return Look::kDark;
  return repeated ? Look::kRepeated : Look::kNew;
}

}  // namespace swiftlet
