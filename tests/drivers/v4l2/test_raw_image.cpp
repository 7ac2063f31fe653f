#include <catch2/catch.hpp>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "drivers/v4l2/raw_image.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kUntouched = 0xA5;

/// One pixel as the format's definition has it.
std::uint8_t scalarGrey(const RawImage& image, int x, int y) {
  const std::uint8_t* pixel = image.data + y * image.stride + x * bytesPerPixel(image.format);
  const int wide = bytesPerPixel(image.format) == 2 ? pixel[0] + 256 * pixel[1] : 0;
  switch (image.format) {
    case PixelFormat::kGrey:
    case PixelFormat::kYuyv:
      return pixel[0];
    case PixelFormat::kUyvy:
      return pixel[1];
    case PixelFormat::kY10:
      return static_cast<std::uint8_t>(std::min(wide / 4, 255));
    case PixelFormat::kY16:
      return static_cast<std::uint8_t>(wide / 256);
  }
  return 0;
}

TEST_CASE("Every format becomes grey as its scalar twin says, for any size and stride", "[v4l2]") {
  Random random(7, 0);
  for (const PixelFormat format : kPixelFormats) {
    for (int trial = 0; trial < 60; ++trial) {
      RawImage image;
      image.format = format;
      image.width = 1 + static_cast<int>(random.below(97));
      image.height = 1 + static_cast<int>(random.below(7));
      image.stride = image.width * bytesPerPixel(format) + static_cast<int>(random.below(40));
      // Exactly the bytes that belong to it: a read beyond them is seen by sanitizers.
      std::vector<std::uint8_t> bytes(
          static_cast<std::size_t>(image.stride * (image.height - 1) + image.width * bytesPerPixel(format)));
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.below(256));
      image.data = bytes.data();
      const int out_stride = image.width + static_cast<int>(random.below(9));
      std::vector<std::uint8_t> out(static_cast<std::size_t>(out_stride * image.height), kUntouched);
      toGrey(image, out.data(), out_stride);
      int wrong = 0;
      for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < out_stride; ++x) {
          const std::uint8_t expected = x < image.width ? scalarGrey(image, x, y) : kUntouched;
          wrong += out[static_cast<std::size_t>(y * out_stride + x)] == expected ? 0 : 1;
        }
      }
      INFO(fourcc(format) << " " << image.width << "x" << image.height << " stride " << image.stride);
      REQUIRE(wrong == 0);
    }
  }
}

TEST_CASE("Two cameras in one image are cut apart without a copy", "[v4l2]") {
  std::vector<std::uint8_t> bytes(2 * 10 * 3 + 12);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i);
  const RawImage whole = {bytes.data(), 10, 3, 24, PixelFormat::kYuyv};
  const auto [left, right] = sideBySide(whole);
  CHECK(left.width == 5);
  CHECK(right.width == 5);
  CHECK(right.height == 3);
  std::vector<std::uint8_t> grey(15);
  toGrey(right, grey.data(), 5);
  CHECK(grey[0] == 10);            // column 5, even byte
  CHECK(grey[4] == 18);            // column 9
  CHECK(grey[14] == 2 * 24 + 18);  // last row
  toGrey(left, grey.data(), 5);
  CHECK(grey[14] == 2 * 24 + 8);
}

TEST_CASE("What lies outside of an image is cut off", "[v4l2]") {
  std::vector<std::uint8_t> bytes(64);
  const RawImage whole = {bytes.data(), 8, 8, 8, PixelFormat::kGrey};
  CHECK(crop(whole, 6, 6, 10, 10).width == 2);
  CHECK(crop(whole, 6, 6, 10, 10).height == 2);
  CHECK(crop(whole, -3, 0, 4, 4).data == bytes.data());
  CHECK(crop(whole, 9, 0, 4, 4).empty());
}

TEST_CASE("Only grey images are seen as they are", "[v4l2]") {
  std::vector<std::uint8_t> bytes(64);
  CHECK(greyView({bytes.data(), 8, 4, 16, PixelFormat::kGrey}).stride == 16);
  CHECK(greyView({bytes.data(), 4, 4, 16, PixelFormat::kY16}).empty());
}

TEST_CASE("Formats are known by their four letters, and no others are taken", "[v4l2]") {
  for (const PixelFormat format : kPixelFormats) CHECK(pixelFormat(fourcc(format)) == format);
  CHECK(pixelFormat("Y16") == PixelFormat::kY16);
  for (const char* other : {"MJPG", "NV12", "Y12 ", "", "YU", "GREYS", "grey"}) CHECK(!pixelFormat(other));
}

}  // namespace
}  // namespace swiftlet
