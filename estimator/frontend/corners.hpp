#pragma once
// Detects new features: the best Shi-Tomasi corner of every grid cell without a feature.
//
// Score: smaller eigenvalue of the 2x2 structure tensor of 3x3 Sobel gradients, summed over a 7x7
// box (Shi, Tomasi, "Good Features to Track", CVPR 1994), in grey^2 / px^2 per pixel. Only cells
// that need a point are evaluated. A corner must be the maximum of its 3x3 neighbourhood, above an
// absolute and a relative threshold, and have a minimum distance from every other feature.
//
// Corners are at whole pixels: the template around a feature is then read without interpolation
// (patch_template.hpp), and any point of the patch can represent the feature.
//
// Memory is reserved by the constructor; cost about 3 ns per evaluated pixel.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/simd.hpp"

namespace swiftlet {

struct CornerSettings {
  float min_distance = 14.0F;  ///< px
  float min_score = 4.0F;      ///< grey^2 / px^2
  float relative = 0.003F;     ///< relative to the best score in this call
};

struct Corner {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
  float score = 0;
};

class CornerDetector {
 public:
  CornerDetector(int width, int height);

  /// px; kMaxCells of this size cover 67 megapixels.
  static constexpr int kMaxCell = 256;

  /// Corners in empty cells, best first, at most `wanted`. `image` must have the border of a Pyramid level.
  /// `occupied`: existing features. `features_at_most`: largest number of features in the whole image, which
  /// determines the cell size.
  using Pixels = FixedVector<Eigen::Vector2f, kMaxFeatures>;
  template <typename Isa = simd::Native>
  void detect(const ImageView& image, const Pixels& occupied, int features_at_most, int wanted,
              const CornerSettings& settings, FixedVector<Corner, kMaxFeatures>& corners);

 private:
  static constexpr int kMaxCells = 1024;

  void block(const Eigen::Vector2f& pixel, float distance);
  [[nodiscard]] bool blocked(int x, int y) const;
  template <typename Isa>
  [[nodiscard]] Corner bestOfCell(const ImageView& image, int x0, int y0, int x1, int y1,
                                  float min_score) const;

  int width_ = 0;
  int height_ = 0;
  int mask_stride_ = 0;
  std::vector<std::uint8_t> mask_;  ///< one byte per kMaskStep x kMaskStep pixels
  FixedVector<Corner, kMaxCells> candidates_;
};

}  // namespace swiftlet
