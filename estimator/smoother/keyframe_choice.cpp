#include "estimator/smoother/keyframe_choice.hpp"

#include <cmath>

namespace swiftlet {
namespace {

// A keyframe of whose landmarks less than this share was seen recently is useless.
constexpr double kMinSharedLandmarks = 0.05;
// A rotation by one radian separates two keyframes as much as this distance.
constexpr double kMetresPerRadian = 1.0;
constexpr double kMinDistance = 1e-2;  // m, keeps the score finite

double separation(const SE3& a, const SE3& b) {
  return (a.translation - b.translation).norm() + kMetresPerRadian * a.rotation.angularDistance(b.rotation) +
         kMinDistance;
}

}  // namespace

std::size_t keyframeToDrop(std::span<const KeyframeInWindow> window, std::size_t candidates) {
  std::size_t best = 0;
  double best_score = -1;
  for (std::size_t k = 0; k < candidates; ++k) {
    const KeyframeInWindow& candidate = window[k];
    if (candidate.seen == 0 || candidate.shared < kMinSharedLandmarks * candidate.seen) return k;
    double density = 0;
    for (std::size_t m = 0; m < window.size(); ++m) {
      if (m == k || !window[m].keyframe) continue;
      density += 1.0 / separation(candidate.T_world_body, window[m].T_world_body);
    }
    const double score = std::sqrt(separation(candidate.T_world_body, window.back().T_world_body)) * density;
    if (score <= best_score) continue;
    best_score = score;
    best = k;
  }
  return best;
}

}  // namespace swiftlet
