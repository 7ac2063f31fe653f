#include "mapping/place/place_pyramid.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "mapping/place/fast_score.hpp"

namespace swiftlet {
namespace {

// Weights of neighbours, in 1/128: a byte times two of them fits 16 bits with its rounding.
constexpr int kWeightBits = 7;
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
    for (int x = 0; x < level.width; ++x) {
      const Neighbour n = source(x, level.width, from_width);
      level.column.push_back(n.first);
      level.weight.push_back(static_cast<std::uint16_t>(n.weight));
    }
  }
  for (auto& row : rows_) row.assign(static_cast<std::size_t>(width), 0);
}

bool PlacePyramid::build(const ImageView& image) {
  Level& base = levels_[0];
  if (image.empty() || image.width != base.width || image.height != base.height) return false;
  for (int y = 0; y < base.height; ++y) {
    std::memcpy(base.pixels.data() + static_cast<std::ptrdiff_t>(y) * base.stride, image.row(y),
                static_cast<std::size_t>(base.width));
  }
  for (std::size_t l = 1; l < static_cast<std::size_t>(octaves_); ++l) shrink(levels_[l - 1], levels_[l]);
  return true;
}

void PlacePyramid::resampleRow(const Level& from, int y, const Level& to,
                               std::vector<std::uint16_t>& out) const {
  const std::uint8_t* row = from.pixels.data() + static_cast<std::ptrdiff_t>(y) * from.stride;
  for (std::size_t x = 0; x < static_cast<std::size_t>(to.width); ++x) {
    const std::uint8_t* two = row + to.column[x];
    out[x] = static_cast<std::uint16_t>(two[0] * (kOne - to.weight[x]) + two[1] * to.weight[x]);
  }
}

void PlacePyramid::shrink(const Level& from, Level& to) {
  int upper = -1;  // the row of `from` that rows_[0] holds; rows_[1] holds the next
  for (int y = 0; y < to.height; ++y) {
    const Neighbour n = source(y, to.height, from.height);
    if (n.first == upper + 1 && upper >= 0) {
      std::swap(rows_[0], rows_[1]);
      resampleRow(from, n.first + 1, to, rows_[1]);
    } else if (n.first != upper) {
      resampleRow(from, n.first, to, rows_[0]);
      resampleRow(from, n.first + 1, to, rows_[1]);
    }
    upper = n.first;
    const auto a = static_cast<std::uint32_t>(kOne - n.weight);
    const auto b = static_cast<std::uint32_t>(n.weight);
    std::uint8_t* out = to.pixels.data() + static_cast<std::ptrdiff_t>(y) * to.stride;
    constexpr std::uint32_t kHalf = 1U << (2 * kWeightBits - 1);
    for (std::size_t x = 0; x < static_cast<std::size_t>(to.width); ++x) {
      out[x] = static_cast<std::uint8_t>((rows_[0][x] * a + rows_[1][x] * b + kHalf) >> (2 * kWeightBits));
    }
  }
}

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
