#include "mapping/place/place_pyramid.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "mapping/place/fast_score.hpp"

namespace swiftlet {
namespace {

// Weights of neighbours are in units of 1/128, so that a weighted byte with rounding fits 15 bits.
constexpr int kWeightBits = 7;
constexpr int kLanes = 16;
constexpr int kHalf = kLanes / 2;
constexpr int kOne = 1 << kWeightBits;

struct Neighbour {
  int first;
  int weight;  // of the one after, in 1/kOne
};

Neighbour source(int at, int size, int from_size) {
  const double place = (at + 0.5) * from_size / size - 0.5;
  const int first = std::clamp(static_cast<int>(std::floor(place)), 0, from_size - 2);
  return {first, static_cast<int>(std::lround(std::clamp(place - first, 0.0, 1.0) * kOne))};
}

}  // namespace

PlacePyramid::PlacePyramid(int width, int height, int octaves)
    : octaves_(std::clamp(octaves, 1, kMaxOctaves)) {
  for (int l = 0; l < octaves_; ++l) {
    Level& level = levels_[static_cast<std::size_t>(l)];
    const double scale = std::pow(kOctaveRatio, -l);
    level.width = static_cast<int>(std::lround(width * scale));
    level.height = static_cast<int>(std::lround(height * scale));
    if (l > 0 && (level.width < 2 || level.height < 2)) {
      octaves_ = l;
      break;
    }
    level.stride = (level.width + kFastScoreOverrun + 31) / 32 * 32;
    level.ratio = {static_cast<float>(width) / static_cast<float>(level.width),
                   static_cast<float>(height) / static_cast<float>(level.height)};
    level.pixels.assign(static_cast<std::size_t>(level.stride) * static_cast<std::size_t>(level.height + 1),
                        0);
    if (l == 0) continue;
    const int from_width = levels_[static_cast<std::size_t>(l - 1)].width;
    // Whole blocks: columns beyond the last repeat it.
    for (int x = 0; x < (level.width + kLanes - 1) / kLanes * kLanes; ++x) {
      const Neighbour n = source(std::min(x, level.width - 1), level.width, from_width);
      if (x % kHalf == 0) level.first.push_back(n.first);
      level.left.push_back(static_cast<std::int16_t>(n.first - level.first.back()));
      level.weight.push_back(static_cast<std::int16_t>(n.weight));
    }
  }
  row_.assign(static_cast<std::size_t>(width + kFastScoreOverrun), 0);
}

template <typename Isa>
bool PlacePyramid::build(const ImageView& image) {
  Level& base = levels_[0];
  if (image.empty() || image.width != base.width || image.height != base.height) return false;
  for (int y = 0; y < base.height; ++y) {
    std::memcpy(base.pixels.data() + static_cast<std::ptrdiff_t>(y) * base.stride, image.row(y),
                static_cast<std::size_t>(base.width));
  }
  for (std::size_t l = 1; l < static_cast<std::size_t>(octaves_); ++l)
    shrink<Isa>(levels_[l - 1], levels_[l]);
  return true;
}

template <typename Isa>
void PlacePyramid::shrink(const Level& from, Level& to) {
  const auto one = Isa::broadcast(1);
  const auto whole = Isa::broadcast(kOne);
  const auto half = Isa::broadcast(kOne / 2);
  for (int y = 0; y < to.height; ++y) {
    const Neighbour n = source(y, to.height, from.height);
    const std::uint8_t* upper = from.pixels.data() + static_cast<std::ptrdiff_t>(n.first) * from.stride;
    const auto below = Isa::broadcast(static_cast<std::int16_t>(n.weight));
    const auto above = Isa::subtract(whole, below);
    // Sums stay below 2^15: 255 * kOne + kOne / 2.
    for (int x = 0; x < from.width; x += kLanes) {
      const auto sum = Isa::add(Isa::multiply(Isa::widen(upper + x), above),
                                Isa::multiply(Isa::widen(upper + from.stride + x), below));
      Isa::storeBytes(row_.data() + x, Isa::template shiftRight<kWeightBits>(Isa::add(sum, half)));
    }
    std::uint8_t* out = to.pixels.data() + static_cast<std::ptrdiff_t>(y) * to.stride;
    for (std::size_t x = 0; x < to.left.size(); x += kLanes) {
      const std::uint8_t* low = row_.data() + to.first[x / kHalf];
      const std::uint8_t* high = row_.data() + to.first[x / kHalf + 1];
      const auto left = Isa::load(to.left.data() + x);
      const auto weight = Isa::load(to.weight.data() + x);
      const auto a = Isa::pick(low, high, Isa::places(left));
      const auto b = Isa::pick(low, high, Isa::places(Isa::add(left, one)));
      const auto sum = Isa::add(Isa::multiply(a, Isa::subtract(whole, weight)), Isa::multiply(b, weight));
      Isa::storeBytes(out + x, Isa::template shiftRight<kWeightBits>(Isa::add(sum, half)));
    }
  }
}

template bool PlacePyramid::build<simd::Native>(const ImageView&);
#ifdef SWIFTLET_SIMD_NATIVE
template bool PlacePyramid::build<simd::Scalar>(const ImageView&);
#endif

ImageView PlacePyramid::level(int octave) const {
  const Level& l = levels_[static_cast<std::size_t>(octave)];
  return {l.pixels.data(), l.width, l.height, l.stride};
}

Eigen::Vector2f PlacePyramid::toImage(int octave, const Eigen::Vector2f& pixel) const {
  return (pixel.array() + 0.5F) * levels_[static_cast<std::size_t>(octave)].ratio - 0.5F;
}

Eigen::Vector2f PlacePyramid::toLevel(int octave, const Eigen::Vector2f& pixel) const {
  return (pixel.array() + 0.5F) / levels_[static_cast<std::size_t>(octave)].ratio - 0.5F;
}

}  // namespace swiftlet
