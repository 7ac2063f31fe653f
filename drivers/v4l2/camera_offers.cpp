#include "drivers/v4l2/camera_offers.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>

#include "drivers/image/pixel_format.hpp"

namespace swiftlet {
namespace {

// Bounds of the enumerations; the largest driver seen offers 70 formats and 30 sizes.
constexpr std::uint32_t kMaxFormats = 128;
constexpr std::uint32_t kMaxSizes = 64;
constexpr std::uint32_t kMaxRates = 64;
constexpr int kMaxNodes = 256;          // V4L2 numbers its nodes with 8 bits
constexpr std::size_t kWordBytes = 48;  // "16x16 to 65535x65535"

/// "Y16", or "Y16-BE" for big-endian, which the code's top bit marks.
std::array<char, 8> letters(std::uint32_t code) {
  std::array<char, 8> text = {};
  std::size_t length = 0;
  for (unsigned i = 0; i < 4; ++i) {
    const char letter = static_cast<char>((code >> (8 * i)) & 0x7fU);
    if (letter != ' ') text[length++] = letter;
  }
  if ((code >> 31U) != 0) std::memcpy(text.data() + length, "-BE", 3);
  return text;
}

bool isTaken(std::uint32_t code) { return pixelFormat(letters(code).data()).has_value(); }

/// Text of bounded length; words that do not fit are dropped.
class Text {
 public:
  Text(char* out, std::size_t size) : out_(out), size_(size) { out[0] = '\0'; }
  void add(const char* separator, const char* words) {
    if (full_) return;
    const std::size_t room = size_ - used_;
    const int written = std::snprintf(out_ + used_, room, "%s%s", used_ == 0 ? "" : separator, words);
    full_ = written < 0 || static_cast<std::size_t>(written) >= room;
    if (!full_) {
      used_ += static_cast<std::size_t>(written);
      return;
    }
    const std::string_view cut(out_, size_ - 1);
    const std::size_t blank = cut.find_last_of(' ');
    if (blank != std::string_view::npos) out_[blank > 0 && out_[blank - 1] == ',' ? blank - 1 : blank] = '\0';
  }

 private:
  char* out_;
  std::size_t size_;
  std::size_t used_ = 0;
  bool full_ = false;
};

template <typename Visit>
void forEachFormat(const VideoNode& node, const Visit& visit) {
  for (std::uint32_t i = 0; i < kMaxFormats; ++i) {
    v4l2_fmtdesc format = {};
    format.index = i;
    format.type = node.type();
    if (node.call(VIDIOC_ENUM_FMT, &format) != 0) return;
    visit(format.pixelformat);
  }
}

template <typename Visit>
void forEachSize(const VideoNode& node, std::uint32_t code, const Visit& visit) {
  std::array<char, kWordBytes> word = {};
  for (std::uint32_t i = 0; i < kMaxSizes; ++i) {
    v4l2_frmsizeenum size = {};
    size.index = i;
    size.pixel_format = code;
    if (node.call(VIDIOC_ENUM_FRAMESIZES, &size) != 0) return;
    if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      std::snprintf(word.data(), word.size(), "%ux%u", size.discrete.width, size.discrete.height);
      visit(word.data());
    } else {
      std::snprintf(word.data(), word.size(), "%ux%u to %ux%u", size.stepwise.min_width,
                    size.stepwise.min_height, size.stepwise.max_width, size.stepwise.max_height);
      visit(word.data());
      return;
    }
  }
}

/// `visit(rate, discrete)`: if not discrete, the rate is the highest of a range.
template <typename Visit>
void forEachRate(const VideoNode& node, std::uint32_t fourcc, int width, int height, const Visit& visit) {
  for (std::uint32_t i = 0; i < kMaxRates; ++i) {
    v4l2_frmivalenum interval = {};
    interval.index = i;
    interval.pixel_format = fourcc;
    interval.width = static_cast<std::uint32_t>(width);
    interval.height = static_cast<std::uint32_t>(height);
    if (node.call(VIDIOC_ENUM_FRAMEINTERVALS, &interval) != 0) return;
    const bool discrete = interval.type == V4L2_FRMIVAL_TYPE_DISCRETE;
    const v4l2_fract shortest = discrete ? interval.discrete : interval.stepwise.min;
    visit(static_cast<double>(shortest.denominator) / std::max(1U, shortest.numerator), discrete);
    if (!discrete) return;
  }
}

CameraListing ask(const std::string& path) {
  CameraListing listing;
  listing.path = path;
  VideoNode node;
  listing.fault = node.open(path.c_str(), VideoNode::Role::kCapture);
  if (!listing.fault.ok()) return listing;
  v4l2_capability capability = {};
  if (node.call(VIDIOC_QUERYCAP, &capability) == 0) {
    listing.driver = reinterpret_cast<const char*>(capability.driver);
    listing.card = reinterpret_cast<const char*>(capability.card);
    listing.bus = reinterpret_cast<const char*>(capability.bus_info);
  }
  forEachFormat(node, [&](std::uint32_t code) {
    FormatOffer offer;
    offer.fourcc = letters(code).data();
    offer.taken = isTaken(code);
    forEachSize(node, code, [&](const char* size) { offer.sizes.emplace_back(size); });
    listing.formats.push_back(std::move(offer));
  });
  return listing;
}

}  // namespace

bool offersFormat(const VideoNode& node, std::uint32_t fourcc) {
  bool offered = false;
  forEachFormat(node, [&](std::uint32_t other) { offered = offered || other == fourcc; });
  return offered;
}

void writeFormats(const VideoNode& node, char* out, std::size_t size) {
  Text text(out, size);
  for (const bool taken : {true, false}) {
    forEachFormat(node, [&](std::uint32_t code) {
      if (isTaken(code) == taken) text.add(" ", letters(code).data());
    });
  }
}

void writeSizes(const VideoNode& node, std::uint32_t fourcc, char* out, std::size_t size) {
  Text text(out, size);
  forEachSize(node, fourcc, [&](const char* word) { text.add(" ", word); });
}

void writeRates(const VideoNode& node, std::uint32_t fourcc, int width, int height, char* out,
                std::size_t size) {
  Text text(out, size);
  std::array<char, kWordBytes> word = {};
  forEachRate(node, fourcc, width, height, [&](double rate, bool discrete) {
    std::snprintf(word.data(), word.size(), "%s%.4g", discrete ? "" : "up to ", rate);
    text.add(" ", word.data());
  });
}

std::optional<double> slowestOffered(const VideoNode& node, std::uint32_t fourcc, int width, int height,
                                     double at_least) {
  std::optional<double> slowest;
  forEachRate(node, fourcc, width, height, [&](double rate, bool discrete) {
    if (rate < at_least) return;
    const double offered = discrete ? rate : at_least;
    slowest = std::min(slowest.value_or(offered), offered);
  });
  return slowest;
}

std::vector<CameraListing> listCameras() {
  std::vector<CameraListing> found;
  for (int number = 0; number < kMaxNodes; ++number) {
    const std::string path = "/dev/video" + std::to_string(number);
    std::error_code ignored;
    if (std::filesystem::exists(path, ignored)) found.push_back(ask(path));
  }
  return found;
}

}  // namespace swiftlet
