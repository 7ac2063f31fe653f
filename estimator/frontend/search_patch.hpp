#pragma once
// Whole-pixel matching: zero-mean normalized correlation of a small square with an image, in integers. 25 ns
// per position on AVX2.

#include <cstdint>

#include "estimator/core/image_view.hpp"
#include "estimator/core/simd.hpp"

namespace swiftlet {

class SearchPatch {
 public:
  static constexpr int kRadius = 5;
  static constexpr int kSide = 2 * kRadius + 1;

  /// `centre` points to the central pixel. False if the patch is flat.
  [[nodiscard]] bool build(const std::uint8_t* centre, int stride);

  /// Correlation in [-1, 1] of the patch with the image around (x, y); 0 if the image is flat.
  /// Reads kRadius + 11 pixels around.
  template <typename Isa = simd::Native>
  [[nodiscard]] float correlation(const ImageView& image, int x, int y) const;

 private:
  static constexpr int kLanes = 16;
  alignas(32) std::int16_t pixel_[kSide * kLanes];  ///< zero beyond the patch
  std::int32_t sum_ = 0;
  float norm_ = 0;  ///< sqrt(n sum T^2 - (sum T)^2)
};

}  // namespace swiftlet
