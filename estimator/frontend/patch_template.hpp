#pragma once
// The template of one Lucas-Kanade alignment at one pyramid level, and the alignment itself.
//
// Model: I(x + p) = (1 + g) T(x) + o, translation p, gain g and offset o, weighted least squares
// over a kPatchSize x kPatchSize window, inverse compositional (Baker, Matthews, "Lucas-Kanade 20
// Years On", IJCV 2004): gradients and Hessian come from the template, once.
//
// Gain and offset are eliminated in advance: with G the template's gradient images made orthogonal
// (in the weighted inner product) to T and to 1, the step is
//     dp = -H^-1 sum_x G(x) I(x + p),     H = sum_x w G G^T,
// without residual image, gain or offset. And because bilinear interpolation is linear in the
// pixels, sum G(x) I(x + p) inside one pixel cell is the bilinear mix of its values at the cell's
// four corners: eight integer correlations per cell give every iteration in that cell for nothing.
//
// The template is centred on a whole pixel, so that it is read without interpolation; the caller
// keeps the feature's sub-pixel offset from it. Cost: about 0.1 us to build, 0.1 us per cell.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>

#include "estimator/core/image_view.hpp"
#include "estimator/core/simd.hpp"

namespace swiftlet {

/// Window side in pixels, odd, at most 15: a row and one spare column fill a 16-lane vector.
inline constexpr int kPatchSize = 13;
inline constexpr int kPatchRadius = kPatchSize / 2;
static_assert(kPatchSize % 2 == 1 && kPatchSize <= 15);

/// Weights of the window's pixels, kPatchSize rows of 16; zero beyond the window.
const float* patchWindow();

struct AlignmentLimits {
  int cells = 8;                  ///< pixel cells visited at most
  float stop = 0.01F;             ///< px: smaller steps end the alignment
  float max_displacement = 12.F;  ///< px from the guess: further is lost
};

class PatchTemplate {
 public:
  /// `centre` points to the template's central pixel; kPatchRadius + 1 pixels around it are used
  /// (rows are read 17 pixels wide).
  /// False when the window does not fix both directions (flat, or a straight edge).
  template <typename Isa = simd::Native>
  [[nodiscard]] bool build(const std::uint8_t* centre, int stride);

  /// Moves `position` (of the template's centre, in `image` pixels) to the best match. False when
  /// it leaves the image by more than a few pixels, moves too far or does not settle. Needs the
  /// border of a Pyramid level around the image.
  template <typename Isa = simd::Native>
  [[nodiscard]] bool align(const ImageView& image, const AlignmentLimits& limits,
                           Eigen::Vector2f& position) const;

  /// Zero-mean normalized cross correlation with the image at `position`, weighted, in [-1, 1].
  [[nodiscard]] float correlation(const ImageView& image, const Eigen::Vector2f& position) const;

  /// Smaller eigenvalue of the Hessian per unit of weight [grey^2 / px^2].
  [[nodiscard]] float minEigenvalue() const { return min_eigenvalue_; }

 private:
  static constexpr int kLanes = 16;
  static constexpr int kRows = kPatchSize;

  alignas(32) std::int16_t gradient_x_[kRows * kLanes];  ///< w G, scaled; zero beyond the window
  alignas(32) std::int16_t gradient_y_[kRows * kLanes];
  Eigen::Matrix2f inverse_hessian_;      ///< of the scaled gradients
  Eigen::Vector2f template_projection_;  ///< sum of the rounded, scaled w G times T
  float min_eigenvalue_ = 0;
  const std::uint8_t* centre_ = nullptr;
  int stride_ = 0;
};

}  // namespace swiftlet
