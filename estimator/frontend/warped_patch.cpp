#include "estimator/frontend/warped_patch.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace swiftlet {

bool WarpedPatch::sample(const ImageView& source, const Eigen::Vector2f& centre,
                         const Eigen::Matrix2f& inverse_warp, int border) {
  const auto reach = static_cast<float>(kReach);
  const Eigen::Vector2f half = inverse_warp.cwiseAbs() * Eigen::Vector2f(reach, reach);
  const auto low = static_cast<float>(-border);
  if (!(centre.x() - half.x() >= low && centre.y() - half.y() >= low &&
        centre.x() + half.x() < static_cast<float>(source.width - 1 + border) &&
        centre.y() + half.y() < static_cast<float>(source.height - 1 + border))) {
    return false;
  }
  for (int y = 0; y < kSide; ++y) {
    const Eigen::Vector2f start =
        centre + inverse_warp * Eigen::Vector2f(-reach, static_cast<float>(y) - reach);
    const float step_x = inverse_warp(0, 0);
    const float step_y = inverse_warp(1, 0);
    std::uint8_t* out = pixels_ + y * kStride;
    for (int x = 0; x < kSide; ++x) {
      const float px = start.x() + static_cast<float>(x) * step_x;
      const float py = start.y() + static_cast<float>(x) * step_y;
      const float base_x = std::floor(px);
      const float base_y = std::floor(py);
      const float u = px - base_x;
      const float v = py - base_y;
      const std::uint8_t* p = source.row(static_cast<int>(base_y)) + static_cast<int>(base_x);
      const std::uint8_t* q = p + source.stride;
      const float top = static_cast<float>(p[0]) + u * static_cast<float>(p[1] - p[0]);
      const float bottom = static_cast<float>(q[0]) + u * static_cast<float>(q[1] - q[0]);
      out[x] = static_cast<std::uint8_t>(top + v * (bottom - top) + 0.5F);
    }
  }
  return true;
}

bool alignWarped(const Pyramid& from, const Eigen::Vector2f& from_pixel, const Eigen::Matrix2f& warp,
                 const Pyramid& to, int levels, const AlignmentLimits& limits, Eigen::Vector2f& to_pixel,
                 float* correlation) {
  const float determinant = warp.determinant();
  if (!(std::abs(determinant) > 0.05F)) return false;
  const Eigen::Matrix2f inverse = warp.inverse();
  WarpedPatch patch;
  PatchTemplate pattern;
  // Half the border stays for the samples' neighbours.
  constexpr int kBorder = kPyramidBorder / 2;
  for (int level = levels - 1; level >= 0; --level) {
    const auto scale = static_cast<float>(1 << level);
    const auto finish = level == 0 ? PatchTemplate::Finish::kFine : PatchTemplate::Finish::kCoarse;
    const bool built = patch.sample(from.level(level), from_pixel / scale, inverse, kBorder) &&
                       pattern.build(patch.centre(), patch.stride());
    Eigen::Vector2f position = to_pixel / scale;
    const bool found = built && pattern.align(to.level(level), limits, finish, position);
    if (found) to_pixel = position * scale;
    if (!found && level == 0) return false;
  }
  if (correlation != nullptr) *correlation = pattern.correlation(to.level(0), to_pixel);
  return true;
}

}  // namespace swiftlet
