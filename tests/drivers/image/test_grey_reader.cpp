#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <vector>

#include "drivers/image/grey_reader.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

int luma(int red, int green, int blue) {
  return (4899 * red + 9617 * green + 1868 * blue + 8192) / 16384;  // BT.601
}

/// A frame whose bytes end where the image ends: a read beyond them is seen by sanitizers.
struct Frame {
  Frame(const PixelFormat& format, int width, int height, int padding, Random& random) {
    image.format = format;
    image.width = width;
    image.height = height;
    image.stride = format.rowBytes(width) + padding;
    bytes.resize(static_cast<std::size_t>(image.stride * (height - 1) + format.rowBytes(width)));
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.below(256));
    if (format.layout == PixelLayout::kWords && format.bits < 16) {
      // As V4L2 says: the low bits.
      for (std::size_t i = 1; i < bytes.size(); i += 2) {
        bytes[i] &= static_cast<std::uint8_t>((1U << (format.bits - 8U)) - 1U);
      }
    }
    image.data = bytes.data();
  }

  /// One pixel's upper 8 bits as the format's definition has it; `camera` of two.
  [[nodiscard]] int pixel(int x, int y, int camera = 0) const {
    const std::uint8_t* row = bytes.data() + y * image.stride;
    switch (image.format.layout) {
      case PixelLayout::kBytes:
        return row[x];
      case PixelLayout::kWords:
        return (row[2 * x] + 256 * row[2 * x + 1]) >> (image.format.bits - 8);
      case PixelLayout::kEvenBytes:
        return row[2 * x];
      case PixelLayout::kOddBytes:
        return row[2 * x + 1];
      case PixelLayout::kPacked10:
        return row[5 * (x / 4) + x % 4];
      case PixelLayout::kPacked12:
        return row[3 * (x / 2) + x % 2];
      case PixelLayout::kPairs:
        return row[2 * x + camera];
      case PixelLayout::kRgb:
        return luma(row[3 * x], row[3 * x + 1], row[3 * x + 2]);
      case PixelLayout::kBgr:
        return luma(row[3 * x + 2], row[3 * x + 1], row[3 * x]);
      case PixelLayout::kRgbx:
        return luma(row[4 * x], row[4 * x + 1], row[4 * x + 2]);
      case PixelLayout::kBgrx:
        return luma(row[4 * x + 2], row[4 * x + 1], row[4 * x]);
      case PixelLayout::kJpeg:
        break;
    }
    return -1;
  }

  /// What the reader is to make of it.
  [[nodiscard]] int grey(int x, int y, int camera, int left, int width) const {
    if (!image.format.mosaic) return pixel(left + x, y, camera);
    const auto mirrored = [](int i, int size) {
      if (i < 0) i = -i;
      if (i >= size) i = 2 * size - 2 - i;
      return std::clamp(i, 0, size - 1);
    };
    int sum = 8;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        sum += (2 - std::abs(dx)) * (2 - std::abs(dy)) *
               pixel(left + mirrored(x + dx, width), mirrored(y + dy, image.height));
      }
    }
    return sum / 16;
  }

  RawImage image;
  std::vector<std::uint8_t> bytes;
};

TEST_CASE("Every format becomes grey as its scalar twin says, for any size and stride, whole and in halves",
          "[image]") {
  Random random(7, 0);
  for (const PixelFormat& format : kPixelFormats) {
    if (format.layout == PixelLayout::kJpeg) continue;
    for (int trial = 0; trial < 60; ++trial) {
      const bool two = trial % 2 == 1 && format.layout != PixelLayout::kPairs;
      const int width = (two ? 2 : 1) + static_cast<int>(random.below(97));
      const Frame frame(format, width, 1 + static_cast<int>(random.below(7)),
                        2 * static_cast<int>(random.below(20)), random);
      GreyReader reader;
      reader.reserve(format, width, frame.image.height, two);
      const auto images = reader.read(frame.image);
      const bool both = two || format.layout == PixelLayout::kPairs;
      REQUIRE(images.size() == (both ? 2 : 1));
      int wrong = 0;
      for (int camera = 0; camera < static_cast<int>(images.size()); ++camera) {
        const ImageView& view = images[static_cast<std::size_t>(camera)];
        REQUIRE(view.width == (two ? width / 2 : width));
        REQUIRE(view.height == frame.image.height);
        const int left = two ? camera * view.width : 0;
        for (int y = 0; y < view.height; ++y) {
          for (int x = 0; x < view.width; ++x) {
            wrong += view.row(y)[x] == frame.grey(x, y, camera, left, view.width) ? 0 : 1;
          }
        }
      }
      INFO(format.fourcc() << " " << width << "x" << frame.image.height << " stride " << frame.image.stride);
      REQUIRE(wrong == 0);
    }
  }
}

TEST_CASE("8-bit grey is not copied", "[image]") {
  Random random(1, 0);
  const Frame frame(kGrey8, 40, 3, 8, random);
  GreyReader reader;
  reader.reserve(kGrey8, 40, 3, true);
  const auto images = reader.read(frame.image);
  CHECK(images[0].row(2) == frame.bytes.data() + 2 * 48);
  CHECK(images[1].row(0) == frame.bytes.data() + 20);
}

TEST_CASE("Words at the upper end of 16 bits are told from those at the lower", "[image]") {
  const PixelFormat format = *pixelFormat("Y10");
  std::vector<std::uint16_t> words(64 * 4);
  GreyReader reader;
  const auto first = [&] {
    RawImage image{reinterpret_cast<const std::uint8_t*>(words.data()), 64, 4, 128, format};
    return static_cast<int>(reader.read(image)[0].row(3)[0]);
  };
  reader.reserve(format, 64, 4, false);
  std::ranges::fill(words, std::uint16_t{400});
  CHECK(first() == 100);
  // A transfer gone wrong changes nothing for the frames that follow.
  words[5] = 0xFFFF;
  words[70] = 0x8000;
  CHECK(first() == 100);
  words[5] = words[70] = 400;
  CHECK(first() == 100);
  // The Jetson Xavier's: 10 bits at the top, the low ones repeat the high.
  std::ranges::fill(words, std::uint16_t{(400U << 6U) | (400U >> 4U)});
  CHECK(first() == 100);
  // Also when it grows dark.
  std::ranges::fill(words, std::uint16_t{3U << 6U});
  CHECK(first() == 0);
}

TEST_CASE("Formats are known by their four letters, and no others are taken", "[image]") {
  for (const PixelFormat& format : kPixelFormats) CHECK(pixelFormat(format.fourcc()) == format);
  CHECK(pixelFormat("Y16")->bits == 16);
  CHECK(pixelFormat("Y8I")->layout == PixelLayout::kPairs);
  for (const char* other : {"RGB565", "H264", "Z16 ", "", "YU", "GREYS", "grey"}) CHECK(!pixelFormat(other));
}

}  // namespace
}  // namespace swiftlet
