#pragma once
// Alignment of a remembered patch with an image by an affine map: translation, rotation, scale and
// shear of its surroundings, gain and offset of its brightness.
//
// Model: I(W(x)) = a T(x) + b, W(x) = A x + t, weighted least squares over the window of
// patch_template.hpp, inverse compositional: W <- W o dW^-1 (Baker, Matthews, IJCV 2004; affine
// templates: Shi, Tomasi, CVPR 1994). Gain and offset are solved exactly in each iteration; the
// Hessian, with both eliminated and a prior on the affine part, is inverted once per template. The window's
// sums are exact, in integers. One iteration costs about 0.16 us, 0.2 us where the patch is turned.

#include <Eigen/Core>

#include "estimator/core/image_view.hpp"
#include "estimator/frontend/patch_template.hpp"

namespace swiftlet {

class AffineTemplate {
 public:
  /// Prepares the Hessian of the window centred on the whole pixel (x, y) of `patch`. False when
  /// the window does not fix the six parameters. kPatchRadius + 1 pixels around are used; rows are
  /// read 17 pixels wide.
  [[nodiscard]] bool build(const ImageView& patch, int x, int y);

  struct Estimate {
    Eigen::Vector2f position;  ///< of the template's central pixel in the image
    Eigen::Matrix2f warp;      ///< offsets in the template to offsets in the image
    float correlation = 0;     ///< weighted, after the last but one step
  };
  /// Refines `estimate`. False when it leaves the image, degenerates, or when neighbours in a row of the
  /// window come more than 1.85 px apart. `patch` and (x, y) as given to build(). Rows of `image` are read 32
  /// px wide and up to 3 px beyond the window: it needs the border of a Pyramid level.
  template <typename Isa = simd::Native>
  [[nodiscard]] bool align(const ImageView& patch, int x, int y, const ImageView& image, int iterations,
                           Estimate& estimate) const;

  /// Over the window, of an image (greys less 128).
  struct Sums {
    float one = 0;     ///< weight times the image
    float square = 0;  ///< weight times its square
    float value = 0;   ///< weight times it and the template
    /// It times the weighted gradients and their places in the window, as the affine map's parameters.
    Eigen::Matrix<float, 6, 1> moment = Eigen::Matrix<float, 6, 1>::Zero();
  };

 private:
  Sums own_;       ///< of the template
  Sums constant_;  ///< of an image that is 1 everywhere
  Eigen::Matrix<float, 6, 6> inverse_hessian_ = Eigen::Matrix<float, 6, 6>::Zero();
};

}  // namespace swiftlet
