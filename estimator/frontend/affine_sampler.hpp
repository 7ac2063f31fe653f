#pragma once
// A square window of pixels sampled through an affine map, a row at a time, bilinear, in fixed point.
//
// The pixels under one row of the window lie in a few image rows and within 32 columns: each image row is
// interpolated along x for all sixteen lanes at once (two byte shuffles), and neighbouring ones are blended
// along y where a lane needs them. Places are rounded to 1/1024 px; their error is below 1/700 px.
// Nothing is allocated. Cost: about 20 ns a row while the row stays within two image rows, as it does
// for turns of less than 5 degrees; 6 ns for each further one.

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>

#include "estimator/core/image_view.hpp"
#include "estimator/core/simd.hpp"

namespace swiftlet {

template <typename Isa>
class AffineSampler {
 public:
  /// Samples have this many units per grey: 255 grey is 32640.
  static constexpr int kUnitsPerGrey = 128;

  /// Window offsets from -reach to reach in both directions, reach at most 7, go through `warp` (offsets in
  /// the window to offsets in the image). False when a row of it covers more than 29 px in x or in y.
  [[nodiscard]] bool prepare(const Eigen::Matrix2f& warp, int reach) {
    warp_ = warp;
    reach_ = static_cast<float>(reach);
    const float length = 2 * reach_;
    const Eigen::Vector2f end = length * warp.col(0);
    if (!(std::abs(end.x()) <= kLongest && std::abs(end.y()) <= kLongest)) return false;
    low_ = end.cwiseMin(0.0F);
    high_ = end.cwiseMax(0.0F);
    alignas(32) std::array<std::int16_t, 16> x{};
    alignas(32) std::array<std::int16_t, 16> y{};
    const float step_x = warp(0, 0) * kOne;
    const float step_y = warp(1, 0) * kOne;
    for (std::size_t c = 0; c <= static_cast<std::size_t>(2 * reach); ++c) {
      x[c] = rounded(static_cast<float>(c) * step_x);
      y[c] = rounded(static_cast<float>(c) * step_y);
    }
    x_ = Isa::load(x.data());
    y_ = Isa::load(y.data());
    return true;
  }

  /// The window's row at offset `row` from its centre, which lies at `centre` in the image; lanes beyond
  /// the window hold anything. The window must lie in the image, one pixel from its right and lower edge;
  /// image rows are read 32 px wide, whatever their length.
  [[nodiscard]] auto sample(const ImageView& image, const Eigen::Vector2f& centre, int row) const {
    const Eigen::Vector2f start = centre + warp_ * Eigen::Vector2f(-reach_, static_cast<float>(row));
    // A rounding below the first sample, so that no place is negative.
    const float base_x = std::floor(start.x() + low_.x() - kMargin);
    const float base_y = std::floor(start.y() + low_.y() - kMargin);
    const auto x = Isa::add(x_, Isa::broadcast(rounded((start.x() - base_x) * kOne)));
    const auto y = Isa::add(y_, Isa::broadcast(rounded((start.y() - base_y) * kOne)));
    const auto fraction = Isa::broadcast(kOneInteger - 1);
    const auto column = Isa::template shiftRight<kBits>(x);
    Row r{Isa::places(column), Isa::places(Isa::add(column, Isa::broadcast(1))),
          Isa::template shiftLeft<15 - kBits>(Isa::bitAnd(x, fraction))};
    const auto line = Isa::template shiftRight<kBits>(y);
    const auto v = Isa::template shiftLeft<15 - kBits>(Isa::bitAnd(y, fraction));
    const std::uint8_t* from = image.row(static_cast<int>(base_y)) + static_cast<std::ptrdiff_t>(base_x);
    auto above = interpolate(from, r);
    from += image.stride;
    auto below = interpolate(from, r);
    auto result = Isa::add(above, Isa::multiplyFraction(Isa::subtract(below, above), v));
    const int last = static_cast<int>(start.y() + high_.y() + kMargin - base_y);
    for (int k = 1; k <= last; ++k) {
      above = below;
      from += image.stride;
      below = interpolate(from, r);
      const auto here = Isa::add(above, Isa::multiplyFraction(Isa::subtract(below, above), v));
      result = Isa::selectEqual(line, static_cast<std::int16_t>(k), here, result);
    }
    return result;
  }

 private:
  using Lanes = typename Isa::Int16x16;
  struct Row {
    typename Isa::Places left, right;
    Lanes u;  ///< share of the right one, in 1/32768
  };

  static constexpr int kBits = 10;  // of a place behind the point: 31 columns fit 16 bits
  static constexpr std::int16_t kOneInteger = 1 << kBits;
  static constexpr float kOne = kOneInteger;
  static constexpr float kMargin = 2 / kOne;
  static constexpr float kLongest = 29;  // px: with the start's fraction and the neighbour, 32 columns

  static std::int16_t rounded(float x) { return static_cast<std::int16_t>(std::lrint(x)); }

  static Lanes interpolate(const std::uint8_t* from, const Row& r) {
    constexpr int kShift = 7;
    static_assert(1 << kShift == kUnitsPerGrey);
    const auto left = Isa::pick(from, r.left);
    const auto rise = Isa::template shiftLeft<kShift>(Isa::subtract(Isa::pick(from, r.right), left));
    return Isa::add(Isa::template shiftLeft<kShift>(left), Isa::multiplyFraction(rise, r.u));
  }

  Eigen::Matrix2f warp_;
  Eigen::Vector2f low_, high_;  ///< of a row's samples, from its first
  float reach_ = 0;
  Lanes x_, y_;
};

}  // namespace swiftlet
