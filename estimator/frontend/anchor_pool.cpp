#include "estimator/frontend/anchor_pool.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>

namespace swiftlet {
namespace {

constexpr int kRefineIterations = 3;
// A larger correction [px] means that tracker and patch follow different things.
constexpr float kMaxCorrection = 1.0F;
// Correlation that a refined patch must reach.
constexpr float kMinCorrelation = 0.85F;

}  // namespace

void AnchorPatch::take(const Pyramid& image, const Eigen::Vector2f& pixel) {
  for (int level = 0; level < kLevels; ++level) {
    const auto index = static_cast<std::size_t>(level);
    const ImageView& source = image.level(std::min(level, image.levels() - 1));
    const Eigen::Vector2f at = pixel / static_cast<float>(1 << level);
    const int side = kSide[index];
    const int x = static_cast<int>(std::lround(at.x())) - side / 2;
    const int y = static_cast<int>(std::lround(at.y())) - side / 2;
    centre_[index] = at - Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y));
    std::uint8_t* to = pixels_.data() + (level == 0 ? 0 : kSide0 * kSide0);
    // The feature is inside the image, so the pyramid's border covers pixels outside the image.
    for (int r = 0; r < side; ++r) {
      std::memcpy(to + r * side, source.row(y + r) + x, static_cast<std::size_t>(side));
    }
  }
  warp.setIdentity();
  failures = 0;
  valid = true;
  has_template_ = template_.build(view(0), kSide0 / 2, kSide0 / 2);
}

bool AnchorPatch::refine(const ImageView& image, const Eigen::Matrix2f& turn, Eigen::Vector2f& pixel) {
  if (!has_template_) return false;
  const Eigen::Vector2f offset = centre_[0] - Eigen::Vector2f::Constant(static_cast<float>(kSide0 / 2));
  AffineTemplate::Estimate estimate;
  estimate.warp = turn * warp;
  estimate.position = pixel - estimate.warp * offset;
  if (!template_.align(view(0), kSide0 / 2, kSide0 / 2, image, kRefineIterations, estimate)) return false;
  const Eigen::Vector2f refined = estimate.position + estimate.warp * offset;
  if (!(estimate.correlation > kMinCorrelation) || !((refined - pixel).norm() < kMaxCorrection)) return false;
  pixel = refined;
  warp = estimate.warp;
  return true;
}

ImageView AnchorPatch::view(int level) const {
  const int side = kSide[static_cast<std::size_t>(level)];
  return {pixels_.data() + (level == 0 ? 0 : kSide0 * kSide0), side, side, side};
}

Eigen::Vector2f AnchorPatch::centre(int level) const { return centre_[static_cast<std::size_t>(level)]; }

int AnchorPool::acquire(TrackId id) {
  int chosen = -1;
  for (int i = 0; i < kCapacity; ++i) {
    const Anchor& a = (*this)[i];
    if (a.id == 0) {
      chosen = i;
      break;
    }
    if (!a.tracked && (chosen < 0 || a.last_seen < (*this)[chosen].last_seen)) chosen = i;
  }
  assert(chosen >= 0);  // more slots than features can be tracked
  Anchor& anchor = (*this)[chosen];
  anchor.id = id;
  anchor.tracked = true;
  for (AnchorPatch& patch : anchor.patch) patch.valid = false;
  ids_[static_cast<std::size_t>(chosen)] = id;
  return chosen;
}

int AnchorPool::find(TrackId id) const {
  if (id == 0) return -1;
  const auto* at = std::find(ids_.begin(), ids_.end(), id);
  return at == ids_.end() ? -1 : static_cast<int>(at - ids_.begin());
}

void AnchorPool::clear() {
  ids_.fill(0);
  for (Anchor& anchor : anchors_) {
    anchor.id = 0;
    anchor.tracked = false;
  }
}

}  // namespace swiftlet
