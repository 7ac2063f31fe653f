#pragma once
// Pyramidal Lucas-Kanade: tracks a point from one image to the next, coarse to fine, with a backward check.
//
// Positions are pixels of level 0. A level with a flat template or a lost alignment is skipped; the finer
// levels then start from the initial guess. Source: Bouguet, "Pyramidal Implementation of the Lucas Kanade
// Feature Tracker", 2000. Alignment: patch_template.hpp.

#include <Eigen/Core>

#include "estimator/frontend/patch_template.hpp"
#include "estimator/frontend/pyramid.hpp"

namespace swiftlet {

struct LucasKanadeSettings {
  int levels = 4;           ///< the coarsest level is levels - 1
  float back_check = 0.5F;  ///< px; 0 disables the check
  int back_levels = 2;      ///< levels of the backward check
  AlignmentLimits limits;
};

/// Finds `from_pixel` of `from` in `to`. `to_pixel` is the initial guess and receives the result. False if
/// lost; `to_pixel` is then undefined. About 2.3 us over four levels without the backward check.
[[nodiscard]] bool trackPoint(const Pyramid& from, const Eigen::Vector2f& from_pixel, const Pyramid& to,
                              const LucasKanadeSettings& settings, Eigen::Vector2f& to_pixel);

/// The backward check: tracks from `to_pixel`; true if the result is within `back_check` of `from_pixel`.
[[nodiscard]] bool tracksBack(const Pyramid& from, const Eigen::Vector2f& from_pixel, const Pyramid& to,
                              const LucasKanadeSettings& settings, const Eigen::Vector2f& to_pixel);

/// Whether the whole patch around `pixel` is in the image.
[[nodiscard]] bool patchInside(const ImageView& image, const Eigen::Vector2f& pixel);

}  // namespace swiftlet
