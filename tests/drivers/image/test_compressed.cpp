// Motion JPEG of an encoder that is not ours, whole, as cameras send it, and broken.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <vector>

#include "drivers/image/grey_reader.hpp"
#include "estimator/core/random.hpp"
#include "tests/drivers/image/ffmpeg.hpp"

namespace swiftlet {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kWidth = 320;
constexpr int kHeight = 176;

class Reader {
 public:
  explicit Reader(bool side_by_side = false) {
    reader_.reserve(*pixelFormat("MJPG"), kWidth, kHeight, side_by_side);
  }
  std::span<const ImageView> read(const Bytes& jpeg) {
    RawImage image{jpeg.data(), kWidth, kHeight, 0, *pixelFormat("MJPG")};
    image.bytes = jpeg.size();
    return reader_.read(image);
  }

 private:
  GreyReader reader_;
};

int farthest(const ImageView& image, const Bytes& reference, int left = 0) {
  int worst = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      worst = std::max(
          worst, std::abs(image.row(y)[x] - reference[static_cast<std::size_t>(y * kWidth + left + x)]));
    }
  }
  return worst;
}

/// Without the segments of one marker.
Bytes without(const Bytes& jpeg, std::uint8_t marker) {
  Bytes out(jpeg.begin(), jpeg.begin() + 2);
  for (std::size_t at = 2; at + 4 <= jpeg.size();) {
    constexpr std::uint8_t kStartOfScan = 0xDA;
    const std::size_t length =
        jpeg[at + 1] == kStartOfScan ? jpeg.size() - at : 2U + jpeg[at + 2] * 256U + jpeg[at + 3];
    if (jpeg[at + 1] != marker)
      out.insert(out.end(), jpeg.begin() + static_cast<std::ptrdiff_t>(at),
                 jpeg.begin() + static_cast<std::ptrdiff_t>(at + length));
    at += length;
  }
  return out;
}

TEST_CASE("Motion JPEG is decoded as FFmpeg decodes it", "[image]") {
  const ffmpeg::Picture picture = ffmpeg::picture(kWidth, kHeight);
  Reader reader;
  for (const char* format : {"yuvj420p", "yuvj422p", "yuvj444p"}) {
    for (const int quality : {2, 10, 31}) {
      const Bytes jpeg = ffmpeg::jpeg(picture, format, quality);
      const auto images = reader.read(jpeg);
      REQUIRE(images.size() == 1);
      const int worst = farthest(images[0], ffmpeg::luma(jpeg));
      std::printf("MJPG %s, quality %d, %zu bytes: at most %d levels\n", format, quality, jpeg.size(), worst);
      CHECK(worst <= 1);
    }
  }
}

TEST_CASE("Motion JPEG as cameras send it: without tables, with zeros behind it, with stray bytes",
          "[image]") {
  const Bytes whole = ffmpeg::jpeg(ffmpeg::picture(kWidth, kHeight), "yuvj422p", 3);
  const Bytes reference = ffmpeg::luma(whole);
  constexpr std::uint8_t kHuffmanTables = 0xC4;
  const Bytes bare = without(whole, kHuffmanTables);
  REQUIRE(bare.size() < whole.size());
  Bytes padded = whole;
  padded.resize(whole.size() + 4096);
  Bytes stray = whole;
  stray.insert(stray.end() - 2, {0, 0});
  for (const Bytes& jpeg : {bare, padded, stray}) {
    Reader reader;
    const auto images = reader.read(jpeg);
    REQUIRE(images.size() == 1);
    CHECK(farthest(images[0], reference) <= 1);
  }
}

TEST_CASE("Two cameras in one JPEG", "[image]") {
  const Bytes jpeg = ffmpeg::jpeg(ffmpeg::picture(kWidth, kHeight), "yuvj422p", 3);
  const Bytes reference = ffmpeg::luma(jpeg);
  Reader reader(true);
  const auto images = reader.read(jpeg);
  REQUIRE(images.size() == 2);
  CHECK(images[1].width == kWidth / 2);
  CHECK(farthest(images[0], reference) <= 1);
  CHECK(farthest(images[1], reference, kWidth / 2) <= 1);
}

TEST_CASE("A broken JPEG gives no image, and the next one does", "[image]") {
  const ffmpeg::Picture picture = ffmpeg::picture(kWidth, kHeight);
  const Bytes whole = ffmpeg::jpeg(picture, "yuvj422p", 3);
  const Bytes reference = ffmpeg::luma(whole);
  const Bytes other_size = ffmpeg::jpeg(ffmpeg::picture(kWidth, kHeight / 2), "yuvj422p", 3);
  Reader reader;
  Random random(5, 0);
  std::vector<Bytes> broken = {{}, {0xFF, 0xD8}, Bytes(1000, 0), other_size};
  for (int i = 0; i < 40; ++i) {
    broken.emplace_back(whole.begin(),
                        whole.begin() + random.below(static_cast<std::uint32_t>(whole.size() - 2)));
  }
  for (const Bytes& jpeg : broken) {
    INFO(jpeg.size() << " of " << whole.size() << " bytes");
    CHECK(reader.read(jpeg).empty());
    const auto next = reader.read(whole);
    REQUIRE(next.size() == 1);
    CHECK(farthest(next[0], reference) <= 1);
  }
}

}  // namespace
}  // namespace swiftlet
