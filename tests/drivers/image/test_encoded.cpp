// Uncompressed pixels from encoders that are not ours, within a level of the reference.
#include <libv4l-plugin.h>
#include <libv4lconvert.h>
#include <linux/videodev2.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "drivers/image/grey_reader.hpp"
#include "drivers/image/ros_encoding.hpp"
#include "tests/drivers/image/ffmpeg.hpp"
#include "tests/support/statistics.hpp"

namespace swiftlet {
namespace {

using test::largestDifference;
using Bytes = std::vector<std::uint8_t>;

constexpr int kEncodedWidth = 324;  // libv4l wants whole groups of four
constexpr int kEncodedHeight = 46;

Bytes greyOf(const char* fourcc, const Bytes& bytes, int width = kEncodedWidth) {
  RawImage image;
  image.format = *pixelFormat(fourcc);
  image.width = width;
  image.height = kEncodedHeight;
  image.stride = image.format.rowBytes(width);
  image.data = bytes.data();
  REQUIRE(bytes.size() >= static_cast<std::size_t>(image.stride * kEncodedHeight));
  GreyReader reader;
  reader.reserve(image.format, width, kEncodedHeight, false);
  Bytes out;
  for (const ImageView& view : reader.read(image)) {
    for (int y = 0; y < kEncodedHeight; ++y) out.insert(out.end(), view.row(y), view.row(y) + width);
  }
  return out;
}

TEST_CASE("FFmpeg's pixels of every layout become the grey of its own conversion", "[image]") {
  const ffmpeg::Picture picture = ffmpeg::picture(kEncodedWidth, kEncodedHeight);
  Bytes luma = ffmpeg::as(picture, "yuv444p");
  luma.resize(static_cast<std::size_t>(kEncodedWidth * kEncodedHeight));
  const Bytes grey = ffmpeg::as(picture, "gray");
  struct Pair {
    const char* fourcc;
    const char* name;
    const Bytes& reference;
  };
  const Pair pairs[] = {{"GREY", "gray", grey},    {"Y10", "gray10le", grey}, {"Y12", "gray12le", grey},
                        {"Y14", "gray14le", grey}, {"Y16", "gray16le", grey}, {"NV12", "nv12", luma},
                        {"NM12", "nv12", luma},    {"NV21", "nv21", luma},    {"YU12", "yuv420p", luma},
                        {"YM12", "yuv420p", luma}, {"YV12", "yuv420p", luma}, {"422P", "yuv422p", luma},
                        {"YUYV", "yuyv422", luma}, {"YVYU", "yvyu422", luma}, {"UYVY", "uyvy422", luma}};
  for (const Pair& pair : pairs) {
    const int worst = largestDifference(greyOf(pair.fourcc, ffmpeg::as(picture, pair.name)), pair.reference);
    std::printf("%s from FFmpeg's %s: at most %d levels\n", pair.fourcc, pair.name, worst);
    CHECK(worst <= 1);
  }
}

TEST_CASE("FFmpeg's colours of every order become their luma, also by ROS's names", "[image]") {
  const ffmpeg::Picture picture = ffmpeg::picture(kEncodedWidth, kEncodedHeight);
  Bytes expected;
  for (std::size_t i = 0; i < picture.rgb.size(); i += 3) {
    const double luma = 0.299 * picture.rgb[i] + 0.587 * picture.rgb[i + 1] + 0.114 * picture.rgb[i + 2];
    expected.push_back(static_cast<std::uint8_t>(std::lround(luma)));
  }
  struct Pair {
    const char* fourcc;
    const char* ros;
    const char* name;
  };
  for (const Pair& pair :
       {Pair{"RGB3", "rgb8", "rgb24"}, Pair{"BGR3", "bgr8", "bgr24"}, Pair{"AB24", "rgba8", "rgba"},
        Pair{"XB24", nullptr, "rgb0"}, Pair{"AR24", "bgra8", "bgra"}, Pair{"XR24", nullptr, "bgr0"}}) {
    CHECK(largestDifference(greyOf(pair.fourcc, ffmpeg::as(picture, pair.name)), expected) <= 1);
    if (pair.ros != nullptr) CHECK(rosEncoding(pair.ros, false) == pixelFormat(pair.fourcc));
  }
}

TEST_CASE("Pixels of 16 bits with the high byte first", "[image]") {
  const ffmpeg::Picture picture = ffmpeg::picture(kEncodedWidth, kEncodedHeight);
  const Bytes bytes = ffmpeg::as(picture, "gray16be");
  RawImage image;
  image.format = rosEncoding("mono16", true).value();
  image.width = kEncodedWidth;
  image.height = kEncodedHeight;
  image.stride = image.format.rowBytes(kEncodedWidth);
  image.data = bytes.data();
  GreyReader reader;
  reader.reserve(image.format, kEncodedWidth, kEncodedHeight, false);
  const ImageView view = reader.read(image)[0];
  const Bytes grey(view.row(0), view.row(0) + kEncodedWidth * kEncodedHeight);
  CHECK(grey == greyOf("Y16", ffmpeg::as(picture, "gray16le")));
}

/// Writes bits as they come, the highest of a value first.
class Bits {
 public:
  void put(unsigned value, unsigned count) {
    while (count-- > 0) {
      if (used_ == 0) bytes.push_back(0);
      bytes.back() = static_cast<std::uint8_t>(bytes.back() | ((value >> count) & 1U) << (7U - used_));
      used_ = (used_ + 1) % 8;
    }
  }
  Bytes bytes;

 private:
  unsigned used_ = 0;
};

/// MIPI CSI-2 1.3, sections 11.4.4 and 11.4.5: the high bytes of a group, then their low bits, the first
/// pixel's lowest.
Bytes packed(const std::vector<unsigned>& pixels, unsigned bits) {
  const std::size_t group = bits == 10 ? 4 : 2;
  Bits out;
  for (int y = 0; y < kEncodedHeight; ++y) {
    for (std::size_t x = 0; x < kEncodedWidth; x += group) {
      const auto at = [&](std::size_t i) {
        return x + i < kEncodedWidth ? pixels[static_cast<std::size_t>(y) * kEncodedWidth + x + i] : 0U;
      };
      for (std::size_t i = 0; i < group; ++i) out.put(at(i) >> (bits - 8), 8);
      for (std::size_t i = group; i-- > 0;) out.put(at(i) & ((1U << (bits - 8)) - 1), bits - 8);
    }
  }
  return out.bytes;
}

/// FFmpeg's grey of 16 bits, as a sensor of `bits` has it.
std::vector<unsigned> deep(const ffmpeg::Picture& picture, unsigned bits) {
  const Bytes words = ffmpeg::as(picture, "gray16le");
  std::vector<unsigned> pixels;
  for (std::size_t i = 0; i < words.size(); i += 2) {
    pixels.push_back((words[i] + 256U * words[i + 1]) >> (16 - bits));
  }
  return pixels;
}

TEST_CASE("Packed grey of a packer that goes bit by bit", "[image]") {
  const ffmpeg::Picture picture = ffmpeg::picture(kEncodedWidth, kEncodedHeight);
  const Bytes grey = ffmpeg::as(picture, "gray");
  CHECK(largestDifference(greyOf("Y10P", packed(deep(picture, 10), 10)), grey) <= 1);
  CHECK(largestDifference(greyOf("Y12P", packed(deep(picture, 12), 12)), grey) <= 1);
}

TEST_CASE("Two cameras pixel beside pixel", "[image]") {
  ffmpeg::Picture picture = ffmpeg::picture(kEncodedWidth, kEncodedHeight);
  const Bytes left = ffmpeg::as(picture, "gray");
  std::ranges::reverse(picture.rgb);
  const Bytes right = ffmpeg::as(picture, "gray");
  Bytes both;
  for (std::size_t i = 0; i < left.size(); ++i) {
    both.push_back(left[i]);
    both.push_back(right[i]);
  }
  Bytes expected = left;
  expected.insert(expected.end(), right.begin(), right.end());
  CHECK(greyOf("Y8I", both) == expected);
}

/// The sensor's pixels behind a filter of this order ("RGGB": red at the top left).
std::vector<unsigned> filtered(const ffmpeg::Picture& picture, const std::string& order, unsigned bits) {
  std::vector<unsigned> pixels;
  for (int y = 0; y < kEncodedHeight; ++y) {
    for (int x = 0; x < kEncodedWidth; ++x) {
      const char colour = order[static_cast<std::size_t>(2 * (y % 2) + x % 2)];
      const std::size_t channel = colour == 'R' ? 0 : colour == 'G' ? 1 : 2;
      pixels.push_back(unsigned{picture.rgb[3 * static_cast<std::size_t>(y * kEncodedWidth + x) + channel]}
                       << (bits - 8));
    }
  }
  return pixels;
}

/// (R + 2 G + B) / 4 of what libv4l makes of them.
Bytes byLibv4l(std::uint32_t format, const Bytes& bytes, int stride) {
  libv4l_dev_ops no_camera = {};
  no_camera.ioctl = [](void*, int, unsigned long request, void*) {
    if (request == VIDIOC_QUERYCAP) return 0;
    errno = ENOTTY;
    return -1;
  };
  const std::unique_ptr<v4lconvert_data, void (*)(v4lconvert_data*)> converter(
      v4lconvert_create_with_dev_ops(STDIN_FILENO, nullptr, &no_camera), &v4lconvert_destroy);
  REQUIRE(converter);
  v4l2_format from = {};
  from.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  from.fmt.pix.width = kEncodedWidth;
  from.fmt.pix.height = kEncodedHeight;
  from.fmt.pix.pixelformat = format;
  from.fmt.pix.bytesperline = static_cast<std::uint32_t>(stride);
  from.fmt.pix.sizeimage = static_cast<std::uint32_t>(bytes.size());
  v4l2_format to = from;
  to.fmt.pix.pixelformat = V4L2_PIX_FMT_RGB24;
  to.fmt.pix.bytesperline = 3 * kEncodedWidth;
  to.fmt.pix.sizeimage = 3 * kEncodedWidth * kEncodedHeight;
  Bytes source = bytes;
  Bytes rgb(to.fmt.pix.sizeimage);
  const int written =
      v4lconvert_convert(converter.get(), &from, &to, source.data(), static_cast<int>(source.size()),
                         rgb.data(), static_cast<int>(rgb.size()));
  INFO(v4lconvert_get_error_message(converter.get()));
  REQUIRE(written == static_cast<int>(rgb.size()));
  Bytes grey;
  for (std::size_t i = 0; i < rgb.size(); i += 3) {
    grey.push_back(static_cast<std::uint8_t>((rgb[i] + 2 * rgb[i + 1] + rgb[i + 2] + 2) / 4));
  }
  return grey;
}

TEST_CASE("Pixels behind a Bayer filter become the grey of libv4l's colours", "[image]") {
  const ffmpeg::Picture picture = ffmpeg::picture(kEncodedWidth, kEncodedHeight);
  struct Order {
    const char* order;
    const char* bytes;
    const char* packed10;
    const char* packed12;
    const char* words;
  };
  for (const Order& order :
       {Order{"BGGR", "BA81", "pBAA", "pBCC", "BG10"}, Order{"GBRG", "GBRG", "pGAA", "pGCC", "GB10"},
        Order{"GRBG", "GRBG", "pgAA", "pgCC", "BA10"}, Order{"RGGB", "RGGB", "pRAA", "pRCC", "RG10"}}) {
    Bytes eight;
    for (const unsigned pixel : filtered(picture, order.order, 8))
      eight.push_back(static_cast<std::uint8_t>(pixel));
    const auto code = [](const char* letters) {
      std::uint32_t value = 0;
      std::memcpy(&value, letters, sizeof(value));
      return value;
    };
    const Bytes grey = greyOf(order.bytes, eight);
    const Bytes ten = packed(filtered(picture, order.order, 10), 10);
    int worst = 0;
    for (const Bytes& reference : {byLibv4l(code(order.bytes), eight, kEncodedWidth),
                                   byLibv4l(code(order.packed10), ten, 5 * kEncodedWidth / 4)}) {
      // libv4l copies pixels at the border instead of mirroring them.
      for (int y = 2; y < kEncodedHeight - 2; ++y) {
        for (int x = 2; x < kEncodedWidth - 2; ++x) {
          const auto i = static_cast<std::size_t>(y * kEncodedWidth + x);
          worst = std::max(worst, std::abs(grey[i] - reference[i]));
        }
      }
    }
    std::printf("%s and %s beside libv4l: at most %d levels\n", order.bytes, order.packed10, worst);
    CHECK(worst <= 1);
    // The same pixels packed, and in words.
    CHECK(largestDifference(greyOf(order.packed10, ten), grey) <= 1);
    CHECK(largestDifference(greyOf(order.packed12, packed(filtered(picture, order.order, 12), 12)), grey) <=
          1);
    Bytes words;
    for (const unsigned pixel : filtered(picture, order.order, 10)) {
      words.push_back(static_cast<std::uint8_t>(pixel & 0xFFU));
      words.push_back(static_cast<std::uint8_t>(pixel >> 8U));
    }
    CHECK(largestDifference(greyOf(order.words, words), grey) <= 1);
  }
}

}  // namespace
}  // namespace swiftlet
