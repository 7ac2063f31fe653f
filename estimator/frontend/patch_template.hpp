#pragma once
// The template of one Lucas-Kanade alignment at one pyramid level, and the alignment itself.
//
// Model: I(x + p) = (1 + g) T(x) + o, translation p, gain g and offset o, weighted least squares
// over a kPatchSize x kPatchSize window, inverse compositional (Baker, Matthews, "Lucas-Kanade 20
// Years On", IJCV 2004): gradients and Hessian come from the template, once.
//
// Gain and offset are eliminated in advance. With G the template's gradient images made orthogonal to T and
// to 1 (in the weighted inner product), the step is
//     dp = -H^-1 sum_x G(x) I(x + p),     H = sum_x w G G^T,
// without residual image, gain or offset. Bilinear interpolation is linear in the pixels, so these sums
// inside a pixel cell are the bilinear mix of their values at the cell's four corners. Sixteen integer
// correlations per cell (image gradients, T and 1 at four corners) give all iterations in that cell.
//
// Two corrections are made at the finest level (`Finish::kFine`).
//  - Estimating gain and offset costs accuracy: under constant light the median error is 24 to 30 % larger
//    than without. If the offset is within noise, the position is therefore computed again with g = o = 0.
//    Only the offset decides, because a change of light changes both, while noise in the template,
//    interpolation and blur only lower the gain.
//  - Bilinear interpolation displaces fine detail by up to 0.02 px. Its error is measured once, at the
//    position found, as the difference from cubic convolution (Keys, "Cubic Convolution Interpolation for
//    Digital Image Processing", 1981), and subtracted from the sums.
//
// The template is centred on a whole pixel, so that it is read without interpolation; the caller keeps the
// sub-pixel offset of the feature. Cost of a track: lucas_kanade.hpp.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/core/image_view.hpp"
#include "estimator/core/simd.hpp"
#include "estimator/frontend/patch_window.hpp"

namespace swiftlet {

struct AlignmentLimits {
  int cells = 8;                  ///< largest number of pixel cells visited; then the last position is used
  float stop = 0.01F;             ///< px: stops at smaller steps
  float max_displacement = 12.F;  ///< px: lost if farther from the initial guess
};

class PatchTemplate {
 public:
  /// kFine: the position is final; kCoarse: it is the initial guess for a finer level.
  enum class Finish { kCoarse, kFine };

  /// `centre` points to the template's central pixel; uses kPatchRadius + 1 pixels around it and reads rows
  /// 17 pixels wide. False if the window does not determine both directions (flat, or a straight edge).
  template <typename Isa = simd::Native>
  [[nodiscard]] bool build(const std::uint8_t* centre, int stride);

  /// Moves `position` (of the template's centre, in pixels of `image`) to the best match. False if it leaves
  /// the image by more than a few pixels or moves too far. If it has not converged after `limits.cells`
  /// cells, the last position is used. Needs the border of a Pyramid level around the image.
  template <typename Isa = simd::Native>
  [[nodiscard]] bool align(const ImageView& image, const AlignmentLimits& limits, Finish finish,
                           Eigen::Vector2f& position) const;

  /// Zero-mean normalized cross correlation with the image at `position`, weighted, in [-1, 1].
  [[nodiscard]] float correlation(const ImageView& image, const Eigen::Vector2f& position) const;

 private:
  static constexpr int kLanes = kPatchLanes;
  static constexpr int kRows = kPatchSize;

  /// Whether gain and offset are estimated.
  enum class Light { kFree, kFixed };
  /// Sums over the window of an image times w 2G_x, w 2G_y, w (T - 128) and w, w in 1/16.
  using Sums = std::array<std::int32_t, 4>;
  /// The sums at the corners (0,0), (1,0), (0,1), (1,1) of a pixel cell.
  struct Cell {
    Eigen::Vector2f base = Eigen::Vector2f::Zero();
    std::array<Sums, 4> sums{};
    Eigen::Vector4f correction = Eigen::Vector4f::Zero();  ///< added to each projection
    bool visited = false;
  };

  [[nodiscard]] bool factor(const Eigen::Matrix2f& products, const Eigen::Vector2f& slope,
                            const Eigen::Vector2f& level);
  template <typename Isa>
  void visit(const ImageView& image, Cell& cell) const;
  [[nodiscard]] Eigen::Vector4f projection(const Sums& sums) const;
  [[nodiscard]] Eigen::Vector2f step(const Eigen::Vector4f& e, Light light) const;
  /// Moves `position` inside the cell. False if it leaves the cell or does not converge.
  bool iterate(const Cell& cell, Light light, float stop, Eigen::Vector2f& position) const;
  template <typename Isa>
  bool settle(const ImageView& image, const AlignmentLimits& limits, Light light,
              const Eigen::Vector2f& guess, Cell& cell, Eigen::Vector2f& position) const;
  /// Measures the interpolation error at `position` and whether the light has changed.
  [[nodiscard]] Light correct(const ImageView& image, const Eigen::Vector2f& position, Cell& cell) const;

  alignas(32) std::int16_t gradient_x_[kRows * kLanes];  ///< w 2G_x, w in 1/16; zero beyond the window
  alignas(32) std::int16_t gradient_y_[kRows * kLanes];
  alignas(32) std::int16_t weighted_t_[kRows * kLanes];  ///< w (T - 128)
  Sums own_{};                                           ///< of the template itself
  Eigen::Matrix2f step_free_;                            ///< projections on 2G to steps, with gain and offset
  Eigen::Matrix2f step_fixed_;                           ///< the same without gain and offset
  Eigen::Vector2f slope_;                                ///< regression of 2G on T
  Eigen::Vector2f level_;                                ///< mean of 2G
  float mean_ = 0;                                       ///< of T - 128 [grey]
  float variance_ = 0;                                   ///< of T [grey^2]
  float level_share_ = 0;  ///< share of the offset's information that remains with free position
  const std::uint8_t* centre_ = nullptr;
  int stride_ = 0;
};

}  // namespace swiftlet
