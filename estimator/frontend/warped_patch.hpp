#pragma once
// A square of pixels resampled through an affine map: the appearance of a feature in another view.

#include <Eigen/Core>
#include <cstdint>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/frontend/patch_template.hpp"
#include "estimator/frontend/pyramid.hpp"

namespace swiftlet {

class WarpedPatch {
 public:
  /// Samples `source` at centre + inverse_warp * d for every offset d of a template with its gradient border;
  /// bilinear, rounded to 8 bits. `inverse_warp` takes offsets in the other view to offsets in the source.
  /// `border` pixels around the source may be read too. False if a sample would be outside, and for maps that
  /// stretch a row beyond 1.85 times its length. Reads rows of `source` 32 px wide. About 0.25 us.
  template <typename Isa = simd::Native>
  [[nodiscard]] bool sample(const ImageView& source, const Eigen::Vector2f& centre,
                            const Eigen::Matrix2f& inverse_warp, int border = 0);

  [[nodiscard]] const std::uint8_t* centre() const { return pixels_ + kReach * kStride + kReach; }
  [[nodiscard]] int stride() const { return kStride; }

 private:
  static constexpr int kReach = kPatchRadius + 1;
  static constexpr int kSide = 2 * kReach + 1;
  static constexpr int kStride = 32;  ///< 16-lane loads extend beyond the last column
  alignas(32) std::uint8_t pixels_[(kSide + 1) * kStride]{};
};

/// The map from offsets in one image to offsets in another, whose camera is rotated by `R`, for points at
/// equal distance from both. `before` and `after` are the Jacobians of the projections.
[[nodiscard]] Eigen::Matrix2f pixelWarp(const Matrix23d& before, const Eigen::Matrix3d& R,
                                        const Matrix23d& after);

/// Aligns the patch around `from_pixel` of `from`, warped by `warp` (offsets in `from` to offsets in `to`),
/// at levels - 1 down to 0 of `to`; `finish` is that of level 0. `to_pixel` is the initial guess and receives
/// the result; `correlation` (may be null) receives that at level 0. False if lost.
[[nodiscard]] bool alignWarped(const Pyramid& from, const Eigen::Vector2f& from_pixel,
                               const Eigen::Matrix2f& warp, const Pyramid& to, int levels,
                               const AlignmentLimits& limits, PatchTemplate::Finish finish,
                               Eigen::Vector2f& to_pixel, float* correlation);

}  // namespace swiftlet
