#include "estimator/frontend/warped_patch.hpp"

#include <Eigen/LU>
#include <cmath>

#include "estimator/frontend/affine_sampler.hpp"

namespace swiftlet {

template <typename Isa>
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
  AffineSampler<Isa> sampler;
  if (!sampler.prepare(inverse_warp, kReach)) return false;
  constexpr int kUnits = AffineSampler<Isa>::kUnitsPerGrey;
  static_assert(kUnits == 1 << 7);
  const auto half_unit = Isa::broadcast(kUnits / 2);
  for (int y = 0; y < kSide; ++y) {
    const auto sampled = sampler.sample(source, centre, y - kReach);
    Isa::storeBytes(pixels_ + y * kStride, Isa::template shiftRight<7>(Isa::add(sampled, half_unit)));
  }
  return true;
}

template bool WarpedPatch::sample<simd::Native>(const ImageView&, const Eigen::Vector2f&,
                                                const Eigen::Matrix2f&, int);
#ifdef SWIFTLET_SIMD_NATIVE
template bool WarpedPatch::sample<simd::Scalar>(const ImageView&, const Eigen::Vector2f&,
                                                const Eigen::Matrix2f&, int);
#endif

Eigen::Matrix2f pixelWarp(const Matrix23d& before, const Eigen::Matrix3d& R, const Matrix23d& after) {
  // J_after R J_before^+
  const Eigen::Matrix2d square = before * before.transpose();
  return (after * R * before.transpose() * square.inverse()).cast<float>();
}

bool alignWarped(const Pyramid& from, const Eigen::Vector2f& from_pixel, const Eigen::Matrix2f& warp,
                 const Pyramid& to, int levels, const AlignmentLimits& limits, PatchTemplate::Finish finish,
                 Eigen::Vector2f& to_pixel, float* correlation) {
  const float determinant = warp.determinant();
  if (!(std::abs(determinant) > 0.05F)) return false;
  const Eigen::Matrix2f inverse = warp.inverse();
  WarpedPatch patch;
  PatchTemplate pattern;
  // Half of the border remains for the samples' neighbours.
  constexpr int kBorder = kPyramidBorder / 2;
  for (int level = levels - 1; level >= 0; --level) {
    const auto scale = static_cast<float>(1 << level);
    const bool built = patch.sample(from.level(level), from_pixel / scale, inverse, kBorder) &&
                       pattern.build(patch.centre(), patch.stride());
    Eigen::Vector2f position = to_pixel / scale;
    const bool found = built && pattern.align(to.level(level), limits,
                                              level == 0 ? finish : PatchTemplate::Finish::kCoarse, position);
    if (found) to_pixel = position * scale;
    if (!found && level == 0) return false;
  }
  if (correlation != nullptr) *correlation = pattern.correlation(to.level(0), to_pixel);
  return true;
}

}  // namespace swiftlet
