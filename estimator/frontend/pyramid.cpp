#include "estimator/frontend/pyramid.hpp"

#include <algorithm>
#include <cstring>

namespace swiftlet {
namespace {

constexpr int kMinSide = 16;
constexpr int kRowAlignment = 64;  // bytes: a row starts on a cache line
constexpr int kFilterReach = 2;    // pixels of the 5 taps on either side
constexpr int kLanes = 16;

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
  // Two halves of complete vectors, and room for reading shifted vectors.
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

template <typename Isa>
void Pyramid::halve(int from) {
  const ImageView& fine = view_[static_cast<std::size_t>(from)];
  const ImageView& coarse = view_[static_cast<std::size_t>(from) + 1];
  // One row filtered along y, with even and odd pixels separated; values up to 16 * 255.
  std::int16_t* const even = row_.data();
  std::int16_t* const odd = even + row_.size() / 2;
  const auto six = Isa::broadcast(6);
  const auto half = Isa::broadcast(128);
  for (int y = 0; y < coarse.height; ++y) {
    const std::uint8_t* const first = fine.row(2 * y - kFilterReach) - kFilterReach;
    const auto filtered = [&](int x) {
      const std::uint8_t* p = first + x;
      const auto v0 = Isa::widen(p), v1 = Isa::widen(p += fine.stride), v2 = Isa::widen(p += fine.stride),
                 v3 = Isa::widen(p += fine.stride), v4 = Isa::widen(p += fine.stride);
      const auto sides = Isa::add(Isa::add(v0, v4), Isa::template shiftLeft<2>(Isa::add(v1, v3)));
      return Isa::add(sides, Isa::multiply(v2, six));
    };
    for (int x = 0; x < coarse.width + kFilterReach; x += kLanes) {
      const auto a = filtered(2 * x);
      const auto b = filtered(2 * x + kLanes);
      Isa::store(even + x, Isa::even(a, b));
      Isa::store(odd + x, Isa::odd(a, b));
    }
    std::uint8_t* out = writableRow(from + 1, y);
    // Complete vectors: values written into the border are overwritten later.
    for (int x = 0; x < coarse.width; x += kLanes) {
      const auto ends = Isa::add(Isa::load(even + x), Isa::load(even + x + 2));
      const auto sides = Isa::template shiftLeft<2>(Isa::add(Isa::load(odd + x), Isa::load(odd + x + 1)));
      const auto middle = Isa::multiply(Isa::load(even + x + 1), six);
      // At most 255 * 256 + 128: fits 16 bits, unsigned.
      const auto sum = Isa::add(Isa::add(ends, sides), Isa::add(middle, half));
      Isa::storeBytes(out + x, Isa::template shiftRightUnsigned<8>(sum));
    }
  }
}

template <typename Isa>
void Pyramid::build(const ImageView& image) {
  for (int y = 0; y < image.height; ++y) {
    std::memcpy(writableRow(0, y), image.row(y), static_cast<std::size_t>(image.width));
  }
  replicateBorder(0);
  for (int k = 1; k < levels_; ++k) {
    halve<Isa>(k - 1);
    replicateBorder(k);
  }
}

template void Pyramid::build<simd::Native>(const ImageView&);
#ifdef SWIFTLET_SIMD_NATIVE
template void Pyramid::build<simd::Scalar>(const ImageView&);
#endif

}  // namespace swiftlet
