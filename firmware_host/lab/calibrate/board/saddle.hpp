#pragma once
// Locates the point where two black and two white areas meet, to a hundredth of a pixel.
//
// A model of the blurred crossing of two bent edges is fitted to the grey values around it by Gauss-Newton:
//   I(x) = (1 + g d) (a + b erf(s1 / (sqrt 2 s)) erf(s2 / (sqrt 2 s))),  d = x - c,
//   sk = nk d - kk ((tk d)^2 + s^2) / 2,
// with the centre c, tangents tk, normals nk and curvatures kk of the edges, the blur s, contrast b and the
// shading g. Perspective keeps edges straight, a lens bends them: without curvatures a centre is shifted
// towards the image's middle by 0.01 px at the rim of a common lens, and by another 0.002 px if the vignette
// were added to the grey values instead of multiplied. s^2 / 2 is the shift of a bent edge by blur. Corners
// of all images share such errors, so averaging over images does not remove them. Curvatures increase the
// noise of c by half.
// The noise of c is derived from the fit's residuals. Pixel (0,0) is the centre of the upper left pixel.
// Cost: some 40 us at radius 3, 150 us at radius 6.

#include <Eigen/Core>

#include "estimator/core/image_view.hpp"

namespace swiftlet {

struct SaddleGuess {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  /// Directions of the two edges, both bordering one of the four areas; any length.
  Eigen::Vector2d edge1 = Eigen::Vector2d::UnitX();
  Eigen::Vector2d edge2 = Eigen::Vector2d::UnitY();
  bool dark_between = true;  ///< whether the area between the two edges is dark
  double radius = 3;         ///< px, of the window, which may contain nothing but the two edges
};

struct Saddle {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma = 0;  ///< px, mean over the axes, 1 sigma
};

/// False: outside the image, no crossing with this polarity and these directions, or too noisy.
[[nodiscard]] bool refineSaddle(const ImageView& image, const SaddleGuess& guess, Saddle& saddle);

}  // namespace swiftlet
