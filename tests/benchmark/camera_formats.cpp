// A camera's frame to grey, beside a plain copy of the grey image and beside OpenCV where it has the same
// conversion. One process, CPU time of this thread, least of interleaved repetitions.

#include <turbojpeg.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "drivers/image/grey_reader.hpp"
#include "estimator/core/random.hpp"
#include "tests/support/cpu_time.hpp"

using namespace swiftlet;

namespace {

constexpr int kWidth = 752;
constexpr int kHeight = 480;
constexpr int kRepetitions = 40;
constexpr int kEach = 20;  // conversions of a repetition

std::vector<std::uint8_t> smoothGrey() {
  Random random(1, 0);
  cv::Mat image(kHeight, kWidth, CV_8U);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(random.below(256));
  }
  constexpr double kSigma = 1.5;  // px: what a lens leaves
  cv::GaussianBlur(image, image, {}, kSigma);
  return {image.data, image.data + image.total()};
}

std::vector<std::uint8_t> jpegOf(const std::vector<std::uint8_t>& grey) {
  std::vector<std::uint8_t> rgb;
  for (const std::uint8_t g : grey) rgb.insert(rgb.end(), 3, g);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  constexpr int kQuality = 85;  // as UVC cameras have it
  tjhandle codec = tjInitCompress();
  tjCompress2(codec, rgb.data(), kWidth, 0, kHeight, TJPF_RGB, &bytes, &size, TJSAMP_422, kQuality, 0);
  std::vector<std::uint8_t> out(bytes, bytes + size);
  tjFree(bytes);
  tjDestroy(codec);
  return out;
}

double perCall(double milliseconds) { return 1e3 * milliseconds / kEach; }

}  // namespace

int main() {
  const std::vector<std::uint8_t> grey = smoothGrey();
  const std::vector<std::uint8_t> jpeg = jpegOf(grey);
  std::vector<std::uint8_t> copy(grey.size());
  cv::setNumThreads(1);
  std::printf("%dx%d, us a frame; a copy of the grey image in the same process\n", kWidth, kHeight);
  std::printf("%-6s %8s %8s %7s   %s\n", "format", "grey", "copy", "times", "OpenCV");
  for (const char* letters : {"GREY", "NV12", "YUYV", "Y10", "Y10P", "Y12P", "RGGB", "pRAA", "RG10", "RGB3",
                              "AR24", "Y8I", "MJPG"}) {
    const PixelFormat format = *pixelFormat(letters);
    const bool compressed = format.layout == PixelLayout::kJpeg;
    RawImage image{nullptr, kWidth, kHeight, format.rowBytes(kWidth), format};
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(image.stride * kHeight));
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = grey[i % grey.size()];
    if (format.layout == PixelLayout::kWords) {
      for (std::size_t i = 1; i < bytes.size(); i += 2) bytes[i] &= 3U;
    }
    if (compressed) bytes = jpeg;
    image.data = bytes.data();
    image.bytes = bytes.size();
    GreyReader reader;
    reader.reserve(format, kWidth, kHeight, false);
    const bool yuyv = std::string(letters) == "YUYV";
    const bool rgb = std::string(letters) == "RGB3";
    const bool compared = yuyv || rgb || std::string(letters) == "RGGB";
    const int how = yuyv ? cv::COLOR_YUV2GRAY_YUY2 : rgb ? cv::COLOR_RGB2GRAY : cv::COLOR_BayerRG2GRAY;
    cv::Mat source(kHeight, kWidth, yuyv ? CV_8UC2 : rgb ? CV_8UC3 : CV_8U, bytes.data());
    cv::Mat made;
    double ours = 1e9, plain = 1e9, opencv = 1e9;
    for (int i = 0; i < kRepetitions; ++i) {
      ours = std::min(ours, test::timed([&] {
                        for (int k = 0; k < kEach; ++k) {
                          // 8-bit grey is not touched: its copy is that of the pipeline, which all formats
                          // have.
                          if (reader.read(image).empty()) std::printf("damaged\n");
                        }
                      }));
      plain = std::min(plain, test::timed([&] {
                         for (int k = 0; k < kEach; ++k) std::memcpy(copy.data(), grey.data(), grey.size());
                       }));
      if (compared) {
        opencv = std::min(opencv, test::timed([&] {
                            for (int k = 0; k < kEach; ++k) {
                              cv::cvtColor(source, made, how);
                            }
                          }));
      }
    }
    std::printf("%-6s %8.1f %8.1f %7.2f", letters, perCall(ours), perCall(plain), ours / plain);
    if (compared) std::printf("   %8.1f, ours %.2f of it", perCall(opencv), ours / opencv);
    std::printf("\n");
  }
}
