#include "mapping/place/steered_brief.hpp"

#include <cmath>
#include <numbers>

namespace swiftlet {
namespace {

// Gaussian of 2 px, in 1/256, from the centre outwards.
constexpr std::array<unsigned, 4> kKernel = {54, 49, 34, 18};
static_assert(kKernel[0] + 2 * (kKernel[1] + kKernel[2] + kKernel[3]) == 256);
constexpr unsigned kRound = 128;

constexpr std::size_t kTall = SteeredBrief::kPatchSize;
constexpr std::size_t kStride = SteeredBrief::kPatchStride;
constexpr std::size_t kSpan = SteeredBrief::kOverrun;  // columns smoothed along y, whole vectors

// 255 within kPatchRadius of the centre, else 0.
using Mask = std::array<std::uint8_t, kTall * kStride>;
constexpr Mask discMask() {
  Mask mask{};
  for (int y = -kPatchRadius; y <= kPatchRadius; ++y) {
    for (int x = -kPatchRadius; x <= kPatchRadius; ++x) {
      if (x * x + y * y > kPatchRadius * kPatchRadius) continue;
      mask[static_cast<std::size_t>(y + kPatchRadius) * kStride +
           static_cast<std::size_t>(x + kPatchRadius)] = 255;
    }
  }
  return mask;
}
constexpr Mask kDisc = discMask();

// Weighted sum of seven bytes `step` apart, rounded back to a byte; at most 255 * 256 + 128 before: 16 bits.
inline std::uint8_t weighted(const std::uint8_t* v, std::ptrdiff_t step) {
  unsigned sum = kRound + kKernel[0] * v[0];
  sum += kKernel[1] * (v[-step] + 0U + v[step]);
  sum += kKernel[2] * (v[-2 * step] + 0U + v[2 * step]);
  sum += kKernel[3] * (v[-3 * step] + 0U + v[3 * step]);
  return static_cast<std::uint8_t>(static_cast<std::uint16_t>(sum) >> 8U);
}

}  // namespace

SteeredBrief::SteeredBrief() : turned_(kDirections) {
  for (int d = 0; d < kDirections; ++d) {
    const double angle = 2 * std::numbers::pi * d / kDirections;
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    const auto place = [c, s](int x, int y) {
      const auto px = static_cast<std::size_t>(std::lround(c * x - s * y) + kPatchRadius);
      const auto py = static_cast<std::size_t>(std::lround(s * x + c * y) + kPatchRadius);
      return static_cast<std::uint16_t>(py * kStride + px);
    };
    Places& places = turned_[static_cast<std::size_t>(d)];
    for (std::size_t bit = 0; bit < briefPattern().size(); ++bit) {
      const BriefPair& pair = briefPattern()[bit];
      places[2 * bit] = place(pair.x0, pair.y0);
      places[2 * bit + 1] = place(pair.x1, pair.y1);
    }
  }
}

void SteeredBrief::smooth(const std::uint8_t* centre, std::ptrdiff_t stride, Patch& patch) {
  std::array<std::uint8_t, kSpan> along_y;
  for (std::size_t y = 0; y < kTall; ++y) {
    const std::uint8_t* row = centre + (static_cast<std::ptrdiff_t>(y) - kPatchRadius) * stride - kBorder;
    for (std::size_t x = 0; x < kSpan; ++x) along_y[x] = weighted(row + x, stride);
    std::uint8_t* out = patch.data() + y * kStride;
    for (std::size_t x = 0; x < kStride; ++x) out[x] = weighted(along_y.data() + x + kSmoothRadius, 1);
  }
}

float SteeredBrief::direction(const Patch& patch) {
  std::array<std::uint16_t, kStride> columns{};  // at most 31 * 255
  int along_y = 0;
  for (std::size_t y = 0; y < kTall; ++y) {
    unsigned sum = 0;
    for (std::size_t x = 0; x < kStride; ++x) {
      const auto value = static_cast<std::uint8_t>(patch[y * kStride + x] & kDisc[y * kStride + x]);
      columns[x] = static_cast<std::uint16_t>(columns[x] + value);
      sum += value;
    }
    along_y += (static_cast<int>(y) - kPatchRadius) * static_cast<int>(sum);
  }
  int along_x = 0;
  for (std::size_t x = 0; x < kStride; ++x) along_x += (static_cast<int>(x) - kPatchRadius) * columns[x];
  return std::atan2(static_cast<float>(along_y), static_cast<float>(along_x));
}

Descriptor SteeredBrief::describe(const Patch& patch, float direction) const {
  const long turn = std::lround(direction * static_cast<float>(kDirections / (2 * std::numbers::pi)));
  const Places& places = turned_[static_cast<std::size_t>((turn % kDirections + kDirections) % kDirections)];
  Descriptor descriptor;
  const std::uint16_t* pair = places.data();
  for (std::uint64_t& word : descriptor.words) {
    std::uint64_t bits = 0;
    for (unsigned i = 0; i < 64; ++i, pair += 2) {
      bits |= static_cast<std::uint64_t>(patch[pair[0]] < patch[pair[1]]) << i;
    }
    word = bits;
  }
  return descriptor;
}

}  // namespace swiftlet
