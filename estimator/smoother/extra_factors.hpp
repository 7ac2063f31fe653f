#pragma once
// Factors on extra states: point on a plane, direction of a plane. Observations: landmark_block.hpp.
//
// Residuals r and Jacobians at the current values, with respect to the error states of state.hpp and
// extra_states.hpp; world axes, z up:
//  - point on plane: r = (n . p - d) / sigma; d r = (n^T dp + p^T dn - dd) / sigma.
//  - direction: horizontal (a floor, n along z) r = (n_x, n_y) / sigma; vertical (a wall) r = n_z / sigma.
// Robust like observations (Cauchy at 2 sigma), so that points of another surface do not distort the window.
// Unobservable directions: a translation (dp = t, dd = n . t) and a rotation about z (dp = z x p, dn = z x n)
// change neither a point on a plane nor a vertical plane. The two rows of a horizontal plane depend on the
// rotation only by the sine of their own residual angle, less than sin^2 / sigma^2. Cost: below 1 us each; no
// allocation. Source: Rosinol, Sattler, Pollefeys, Carlone, "Incremental Visual-Inertial 3D Mesh Generation
// with Structural Regularities", ICRA 2019, section III (regularity factors).

#include <cstdint>

#include "estimator/smoother/extra_states.hpp"
#include "estimator/smoother/linear_factor.hpp"
#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet {

enum class ExtraFactorKind : std::uint8_t { kPointOnPlane, kHorizontalPlane, kVerticalPlane };

struct ExtraFactor {
  ExtraFactorKind kind = ExtraFactorKind::kPointOnPlane;
  std::uint8_t plane = kNoExtra;     ///< index of the extra state
  std::uint8_t landmark = kNoExtra;  ///< index of the extra state; only for a point on a plane
  double sigma = 1;                  ///< m, or rad for a direction

  [[nodiscard]] bool touches(std::uint8_t extra) const { return plane == extra || landmark == extra; }
  [[nodiscard]] bool tiesPoint() const { return kind == ExtraFactorKind::kPointOnPlane; }
};

/// `landmark` is ignored for a direction.
void linearize(const ExtraFactor& factor, const ExtraState& plane, const ExtraState& landmark,
               LinearFactor& linear);

}  // namespace swiftlet
