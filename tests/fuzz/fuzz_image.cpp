#include "tests/fuzz/fuzz_image.hpp"

#include <array>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <span>
#include <vector>

#include "drivers/dds/topic_camera.hpp"
#include "drivers/image/grey_reader.hpp"
#include "tests/fuzz/demand.hpp"

namespace swiftlet::fuzz {

void cameraFrame(std::string_view text) {
  constexpr std::size_t kHead = 5;
  if (text.size() < kHead) return;
  const auto head = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const PixelFormat& format = kPixelFormats[head(0) % kPixelFormats.size()];
  const bool two = head(4) % 2 == 1 && format.layout != PixelLayout::kPairs;
  RawImage image;
  image.format = format;
  image.width = (two ? 2 : 1) + head(1);
  image.height = 1 + head(2);
  image.stride = format.rowBytes(image.width) + head(3);
  // Of its own memory, and no longer: reading beyond is seen.
  std::vector<std::uint8_t> bytes(text.begin() + kHead, text.end());
  if (format.layout != PixelLayout::kJpeg) {
    bytes.resize(static_cast<std::size_t>(image.stride) * static_cast<std::size_t>(image.height - 1) +
                 static_cast<std::size_t>(format.rowBytes(image.width)));
  }
  image.data = bytes.data();
  image.bytes = bytes.size();
  GreyReader reader;
  reader.reserve(format, image.width, image.height, two);
  unsigned sum = 0;
  for (int again = 0; again < 2; ++again) {
    const auto images = reader.read(image);
    demand(!images.empty() || format.layout == PixelLayout::kJpeg);
    unsigned seen = 0;
    for (const ImageView& view : images) {
      demand(view.height == image.height && view.width == (two ? image.width / 2 : image.width));
      for (int y = 0; y < view.height; ++y) {
        seen = std::accumulate(view.row(y), view.row(y) + view.width, seen);
      }
    }
    demand(again == 0 || seen == sum);
    sum = seen;
  }
}

void topicImage(std::string_view text) {
  constexpr std::size_t kHead = 16;
  if (text.size() < kHead) return;
  const auto head = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  std::array<std::uint32_t, 3> sizes{};
  std::memcpy(sizes.data(), text.data() + 4, sizeof(sizes));
  const int width = 1 + head(1);
  const int height = 1 + head(2);
  TopicImage message;
  message.compressed = (head(0) & 1U) != 0;
  message.big_endian = (head(0) & 2U) != 0;
  message.width = sizes[0];
  message.height = sizes[1];
  message.step = sizes[2];
  message.encoding = text.substr(kHead, head(3));
  text.remove_prefix(kHead + message.encoding.size());
  // Of its own memory, and no longer: reading beyond is seen.
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  message.data = bytes;
  RawImage image;
  const DeviceFault fault = rawImageOf(message, width, height, image);
  demand(fault.ok() == !image.empty());
  if (!fault.ok()) return;
  GreyReader reader;
  reader.reserve(image.format, width, height, false);
  const std::span<const ImageView> images = reader.read(image);
  demand(!images.empty() || message.compressed);
  unsigned sum = 0;
  for (const ImageView& view : images) {
    demand(view.width == width && view.height == height);
    for (int y = 0; y < height; ++y) sum = std::accumulate(view.row(y), view.row(y) + width, sum);
  }
  // Looked at, so that the reading stays.
  demand(sum <= 255U * 256U * 256U);
}

}  // namespace swiftlet::fuzz
