#include "drivers/image/grey_reader.hpp"

#include <algorithm>
#include <cstring>

namespace swiftlet {
namespace {

constexpr unsigned kGreyBits = 8;
constexpr unsigned kWordBits = 16;
constexpr int kMosaicRows = 3;

bool beyond(const std::uint8_t* row, int width, unsigned bits) {
  unsigned seen = 0;
  for (int x = 0; x < width; ++x) {
    std::uint16_t pixel = 0;
    std::memcpy(&pixel, row + 2 * x, sizeof(pixel));
    seen |= pixel;
  }
  return (seen >> bits) != 0;
}

}  // namespace

void GreyReader::reserve(const PixelFormat& format, int width, int height, bool side_by_side) {
  side_by_side_ = side_by_side;
  upper_end_ = false;
  const auto columns = static_cast<std::size_t>(width);
  const std::size_t cameras = format.layout == PixelLayout::kPairs ? 2 : 1;
  const bool as_it_is = format.layout == PixelLayout::kBytes && !format.mosaic;
  pixels_.assign(as_it_is ? 0 : cameras * columns * static_cast<std::size_t>(height), 0);
  rows_.assign(format.mosaic ? kMosaicRows * columns : 0, 0);
  sums_.assign(format.mosaic ? columns + 2 : 0, 0);
}

std::span<const ImageView> GreyReader::read(const RawImage& frame) {
  RawImage grey = frame;
  shift_ = shiftOf(frame);
  if (frame.format.layout == PixelLayout::kJpeg) {
    ImageSize found;
    const ImageSize size{frame.width, frame.height};
    if (decoder_.decode({frame.data, frame.bytes}, size, pixels_.data(), found) != DecodeResult::kOk)
      return {};
    grey = {pixels_.data(), frame.width, frame.height, frame.width};
  }
  std::array<RawImage, 2> cameras = {grey, grey};
  if (frame.format.layout == PixelLayout::kPairs) {
    cameras[0].format.layout = PixelLayout::kEvenBytes;
    cameras[1].format.layout = PixelLayout::kOddBytes;
  } else if (side_by_side_) {
    cameras = sideBySide(grey);
  } else {
    images_[0] = convert(grey, pixels_.data());
    return std::span(images_).first(1);
  }
  images_[0] = convert(cameras[0], pixels_.data());
  images_[1] = convert(cameras[1], pixels_.data() + pixels_.size() / 2);
  return images_;
}

ImageView GreyReader::convert(const RawImage& image, std::uint8_t* out) {
  if (image.format.layout == PixelLayout::kBytes && !image.format.mosaic) {
    return {image.data + image.left, image.width, image.height, image.stride};
  }
  if (image.format.mosaic) {
    smoothMosaic(image, out);
  } else {
    for (int y = 0; y < image.height; ++y) {
      unpackRow(image, y, shift_, out + static_cast<std::ptrdiff_t>(y) * image.width);
    }
  }
  return {out, image.width, image.height, image.width};
}

void GreyReader::smoothMosaic(const RawImage& image, std::uint8_t* out) {
  const int width = image.width;
  const auto row_at = [&](int y) {
    return rows_.data() + static_cast<std::ptrdiff_t>(y % kMosaicRows) * width;
  };
  const auto mirrored = [&](int y) {
    return std::clamp(y < 0 ? -y : y >= image.height ? 2 * image.height - 2 - y : y, 0, image.height - 1);
  };
  unpackRow(image, 0, shift_, row_at(0));
  for (int y = 0; y < image.height; ++y, out += width) {
    if (y + 1 < image.height) unpackRow(image, y + 1, shift_, row_at(y + 1));
    const std::uint8_t* above = row_at(mirrored(y - 1));
    const std::uint8_t* here = row_at(y);
    const std::uint8_t* below = row_at(mirrored(y + 1));
    std::uint16_t* sums = sums_.data() + 1;
    for (int x = 0; x < width; ++x) {
      sums[x] = static_cast<std::uint16_t>(above[x] + 2 * here[x] + below[x]);
    }
    sums[-1] = sums[std::min(1, width - 1)];
    sums[width] = sums[std::max(width - 2, 0)];
    constexpr int kWeights = 16;
    for (int x = 0; x < width; ++x) {
      out[x] = static_cast<std::uint8_t>((sums[x - 1] + 2 * sums[x] + sums[x + 1] + kWeights / 2) / kWeights);
    }
  }
}

unsigned GreyReader::shiftOf(const RawImage& image) {
  if (image.format.layout != PixelLayout::kWords) return 0;
  if (!upper_end_ && image.format.bits < kWordBits) {
    int rows = 0;
    for (int y = 0; y < image.height; ++y) {
      rows += beyond(image.row(y) + 2 * image.left, image.width, image.format.bits) ? 1 : 0;
    }
    upper_end_ = 2 * rows > image.height;
  }
  return (upper_end_ ? kWordBits : image.format.bits) - kGreyBits;
}

}  // namespace swiftlet
