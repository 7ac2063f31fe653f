#include "estimator/frontend/pyramid.hpp"

#include <algorithm>
#include <cstring>

namespace swiftlet {
namespace {

constexpr int kMinSide = 16;
constexpr int kRowAlignment = 64;  // bytes: a row starts on a cache line
constexpr int kFilterReach = 2;    // pixels on either side of the 5 taps

int alignedStride(int width) {
  return (width + 2 * kPyramidBorder + kRowAlignment - 1) / kRowAlignment * kRowAlignment;
}

}  // namespace

Pyramid::Pyramid(int width, int height, int levels) {
  std::size_t total = 0;
  int w = width;
  int h = height;
  for (int k = 0; k < std::min(levels, kMaxPyramidLevels); ++k) {
    if (k > 0 && std::min(w, h) < kMinSide) break;
    const int stride = alignedStride(w);
    const auto index = static_cast<std::size_t>(k);
    origin_[index] = total + static_cast<std::size_t>(kPyramidBorder * stride + kPyramidBorder);
    total += static_cast<std::size_t>(stride) * static_cast<std::size_t>(h + 2 * kPyramidBorder);
    view_[index] = {nullptr, w, h, stride};
    levels_ = k + 1;
    w = (w + 1) / 2;
    h = (h + 1) / 2;
  }
  storage_.assign(total, 0);
  row_.assign(static_cast<std::size_t>(width + 2 * kRowAlignment), 0);
  for (std::size_t k = 0; k < static_cast<std::size_t>(levels_); ++k) {
    view_[k].data = storage_.data() + origin_[k];
  }
}

std::uint8_t* Pyramid::writableRow(int level, int y) {
  const auto index = static_cast<std::size_t>(level);
  return storage_.data() + origin_[index] + static_cast<std::ptrdiff_t>(y) * view_[index].stride;
}

void Pyramid::replicateBorder(int level) {
  const ImageView& view = view_[static_cast<std::size_t>(level)];
  for (int y = 0; y < view.height; ++y) {
    std::uint8_t* row = writableRow(level, y);
    std::memset(row - kPyramidBorder, row[0], kPyramidBorder);
    std::memset(row + view.width, row[view.width - 1], kPyramidBorder);
  }
  const auto bytes = static_cast<std::size_t>(view.width + 2 * kPyramidBorder);
  for (int y = 1; y <= kPyramidBorder; ++y) {
    std::memcpy(writableRow(level, -y) - kPyramidBorder, writableRow(level, 0) - kPyramidBorder, bytes);
    std::memcpy(writableRow(level, view.height - 1 + y) - kPyramidBorder,
                writableRow(level, view.height - 1) - kPyramidBorder, bytes);
  }
}

void Pyramid::halve(int from) {
  const ImageView& fine = view_[static_cast<std::size_t>(from)];
  const ImageView& coarse = view_[static_cast<std::size_t>(from) + 1];
  const int columns = 2 * coarse.width + 2 * kFilterReach;
  std::uint16_t* filtered = row_.data();
  for (int y = 0; y < coarse.height; ++y) {
    const std::uint8_t* r0 = fine.row(2 * y - 2) - kFilterReach;
    const std::uint8_t* r1 = r0 + fine.stride;
    const std::uint8_t* r2 = r1 + fine.stride;
    const std::uint8_t* r3 = r2 + fine.stride;
    const std::uint8_t* r4 = r3 + fine.stride;
    for (int x = 0; x < columns; ++x) {
      filtered[x] = static_cast<std::uint16_t>(r0[x] + r4[x] + 4 * (r1[x] + r3[x]) + 6 * r2[x]);
    }
    std::uint8_t* out = writableRow(from + 1, y);
    for (int x = 0; x < coarse.width; ++x) {
      const std::uint16_t* f = filtered + 2 * x;
      // At most 255 * 256 + 128: fits 16 bits.
      const auto sum = static_cast<std::uint16_t>(f[0] + f[4] + 4 * (f[1] + f[3]) + 6 * f[2] + 128);
      out[x] = static_cast<std::uint8_t>(sum >> 8);
    }
  }
}

void Pyramid::build(const ImageView& image) {
  for (int y = 0; y < image.height; ++y) {
    std::memcpy(writableRow(0, y), image.row(y), static_cast<std::size_t>(image.width));
  }
  replicateBorder(0);
  for (int k = 1; k < levels_; ++k) {
    halve(k - 1);
    replicateBorder(k);
  }
}

}  // namespace swiftlet
