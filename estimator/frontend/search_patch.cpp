#include "estimator/frontend/search_patch.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace swiftlet {
namespace {

constexpr int kPixels = SearchPatch::kSide * SearchPatch::kSide;
constexpr int kLanes = 16;
// Below this variance [grey^2] a patch is too flat to match.
constexpr float kMinVariance = 4.0F;

constexpr std::array<std::int16_t, kLanes> makeOnes() {
  std::array<std::int16_t, kLanes> ones{};
  for (int i = 0; i < SearchPatch::kSide; ++i) ones[static_cast<std::size_t>(i)] = 1;
  return ones;
}
constexpr std::array<std::int16_t, kLanes> makeMask() {
  std::array<std::int16_t, kLanes> mask{};
  for (int i = 0; i < SearchPatch::kSide; ++i) mask[static_cast<std::size_t>(i)] = -1;
  return mask;
}
alignas(32) constexpr std::array<std::int16_t, kLanes> kOnes = makeOnes();
alignas(32) constexpr std::array<std::int16_t, kLanes> kMask = makeMask();

}  // namespace

bool SearchPatch::build(const std::uint8_t* centre, int stride) {
  sum_ = 0;
  std::int32_t squares = 0;
  const std::uint8_t* row = centre - static_cast<std::ptrdiff_t>(kRadius) * stride - kRadius;
  for (int y = 0; y < kSide; ++y, row += stride) {
    for (int x = 0; x < kLanes; ++x) {
      const std::int16_t v = x < kSide ? row[x] : std::int16_t{0};
      pixel_[y * kLanes + x] = v;
      sum_ += v;
      squares += v * v;
    }
  }
  const float n = static_cast<float>(kPixels);
  const float variance =
      n * static_cast<float>(squares) - static_cast<float>(sum_) * static_cast<float>(sum_);
  norm_ = std::sqrt(std::max(variance, 0.0F));
  return variance > kMinVariance * n * n;
}

template <typename Isa>
float SearchPatch::correlation(const ImageView& image, int x, int y) const {
  auto product = Isa::zero();
  auto sum = Isa::zero();
  auto squares = Isa::zero();
  const auto ones = Isa::load(kOnes.data());
  const auto mask = Isa::load(kMask.data());
  const std::uint8_t* row = image.row(y - kRadius) + (x - kRadius);
  for (int r = 0; r < kSide; ++r, row += image.stride) {
    const auto pixels = Isa::bitAnd(Isa::widen(row), mask);
    product = Isa::multiplyAdd(product, pixels, Isa::load(pixel_ + r * kLanes));
    sum = Isa::multiplyAdd(sum, pixels, ones);
    squares = Isa::multiplyAdd(squares, pixels, pixels);
  }
  const float n = static_cast<float>(kPixels);
  const auto s = static_cast<float>(Isa::total(sum));
  const float variance = n * static_cast<float>(Isa::total(squares)) - s * s;
  if (!(variance > kMinVariance * n * n)) return 0;
  return (n * static_cast<float>(Isa::total(product)) - s * static_cast<float>(sum_)) /
         (std::sqrt(variance) * norm_);
}

template float SearchPatch::correlation<simd::Native>(const ImageView&, int, int) const;
#ifdef SWIFTLET_SIMD_NATIVE
template float SearchPatch::correlation<simd::Scalar>(const ImageView&, int, int) const;
#endif

}  // namespace swiftlet
