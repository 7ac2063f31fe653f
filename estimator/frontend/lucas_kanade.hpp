#pragma once
// Pyramidal Lucas-Kanade: one point from one image to the next, coarse to fine, with a check back.
//
// Positions are pixels of level 0. A level whose template is flat, or whose alignment is lost, is
// skipped: the finer ones then start from the guess. Source: Bouguet, "Pyramidal Implementation of
// the Lucas Kanade Feature Tracker", 2000; the alignment itself: patch_template.hpp.

#include <Eigen/Core>

#include "estimator/frontend/patch_template.hpp"
#include "estimator/frontend/pyramid.hpp"

namespace swiftlet {

struct LucasKanadeSettings {
  int levels = 4;           ///< coarsest level used is levels - 1
  float back_check = 0.5F;  ///< px; 0 switches the check off
  int back_levels = 2;      ///< levels of the way back
  AlignmentLimits limits;
};

/// Finds `from_pixel` of `from` in `to`. `to_pixel` holds the guess and receives the answer.
/// False when lost; `to_pixel` is then unspecified. About 2.3 us over four
/// levels without the check back.
[[nodiscard]] bool trackPoint(const Pyramid& from, const Eigen::Vector2f& from_pixel, const Pyramid& to,
                              const LucasKanadeSettings& settings, Eigen::Vector2f& to_pixel);

/// The way back alone: from `to_pixel` to within `back_check` of `from_pixel`.
[[nodiscard]] bool tracksBack(const Pyramid& from, const Eigen::Vector2f& from_pixel, const Pyramid& to,
                              const LucasKanadeSettings& settings, const Eigen::Vector2f& to_pixel);

/// Whole pixels of the patch around `pixel` lie in the image.
[[nodiscard]] bool patchInside(const ImageView& image, const Eigen::Vector2f& pixel);

}  // namespace swiftlet
