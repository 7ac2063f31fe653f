#include "estimator/frontend/lucas_kanade.hpp"

#include <cmath>

namespace swiftlet {
namespace {

// The patch, one more pixel for gradients, and one for interpolation.
constexpr float kBorder = static_cast<float>(kPatchRadius) + 2.0F;

// `finish` applies to level 0.
bool trackForward(const Pyramid& from, const Eigen::Vector2f& from_pixel, const Pyramid& to, int levels,
                  const AlignmentLimits& limits, PatchTemplate::Finish finish, Eigen::Vector2f& to_pixel) {
  PatchTemplate patch;
  for (int level = std::min(levels, from.levels()) - 1; level >= 0; --level) {
    const ImageView& image = from.level(level);
    const auto scale = static_cast<float>(1 << level);
    const Eigen::Vector2f centre = from_pixel / scale;
    const auto x = static_cast<int>(std::lround(centre.x()));
    const auto y = static_cast<int>(std::lround(centre.y()));
    const Eigen::Vector2f offset(centre.x() - static_cast<float>(x), centre.y() - static_cast<float>(y));
    if (!patch.build(image.row(y) + x, image.stride)) {
      if (level == 0) return false;
      continue;
    }
    Eigen::Vector2f position = to_pixel / scale - offset;
    if (!patch.align(to.level(level), limits, level == 0 ? finish : PatchTemplate::Finish::kCoarse,
                     position)) {
      if (level == 0) return false;
      continue;
    }
    to_pixel = (position + offset) * scale;
  }
  return true;
}

}  // namespace

bool patchInside(const ImageView& image, const Eigen::Vector2f& pixel) {
  return pixel.x() >= kBorder && pixel.y() >= kBorder &&
         pixel.x() <= static_cast<float>(image.width - 1) - kBorder &&
         pixel.y() <= static_cast<float>(image.height - 1) - kBorder;
}

bool trackPoint(const Pyramid& from, const Eigen::Vector2f& from_pixel, const Pyramid& to,
                const LucasKanadeSettings& settings, Eigen::Vector2f& to_pixel) {
  if (!patchInside(from.level(0), from_pixel)) return false;
  if (!trackForward(from, from_pixel, to, settings.levels, settings.limits, PatchTemplate::Finish::kFine,
                    to_pixel)) {
    return false;
  }
  if (!patchInside(to.level(0), to_pixel)) return false;
  return settings.back_check <= 0 || tracksBack(from, from_pixel, to, settings, to_pixel);
}

bool tracksBack(const Pyramid& from, const Eigen::Vector2f& from_pixel, const Pyramid& to,
                const LucasKanadeSettings& settings, const Eigen::Vector2f& to_pixel) {
  Eigen::Vector2f back = from_pixel;
  // The fine finish changes less than the tolerance, so it is not needed here.
  if (!trackForward(to, to_pixel, from, settings.back_levels, settings.limits, PatchTemplate::Finish::kCoarse,
                    back)) {
    return false;
  }
  return (back - from_pixel).squaredNorm() <= settings.back_check * settings.back_check;
}

}  // namespace swiftlet
