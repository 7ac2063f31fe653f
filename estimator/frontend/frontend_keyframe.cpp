// Frontend::Impl: when a frame becomes a keyframe.

#include <cmath>

#include "estimator/core/median.hpp"
#include "estimator/frontend/frontend_impl.hpp"

namespace swiftlet {
namespace {

// Smallest number of values for a median.
constexpr std::size_t kMinForMedian = 5;

}  // namespace

float Frontend::Impl::medianParallax() const {
  FixedVector<float, kMaxFeatures> parallax;
  const Eigen::Quaterniond rotation =
      keyframe_rotation_known_ ? R_keyframe_cur_ : Eigen::Quaterniond::Identity();
  for (const Track& track : tracks_) {
    const std::size_t c = track.live[0] && track.in_keyframe[0] ? 0 : 1;
    if (!track.live[c] || !track.in_keyframe[c]) continue;
    const Eigen::Quaterniond& q = rig_.T_body_cam[c].rotation;
    // The keyframe's bearing as seen now without translation.
    const Eigen::Vector3d expected = q.conjugate() * (rotation.conjugate() * (q * track.keyframe_bearing[c]));
    const double angle = std::atan2(expected.cross(track.bearing[c]).norm(), expected.dot(track.bearing[c]));
    parallax.pushBack(static_cast<float>(angle * rig_.camera[c].focal()));
  }
  return parallax.size() < kMinForMedian ? 0.0F : medianOf(parallax);
}

bool Frontend::Impl::keyframeDue(Stamp stamp) const {
  if (!has_keyframe_) return true;
  const Duration since = stamp - keyframe_stamp_;
  if (since >= settings_.max_keyframe_interval) return true;
  if (since < settings_.min_keyframe_interval) return false;
  int survivors = 0;
  for (const Track& track : tracks_) {
    survivors += (track.live[0] && track.in_keyframe[0]) || (track.live[1] && track.in_keyframe[1]) ? 1 : 0;
  }
  const bool worn =
      static_cast<float>(survivors) < settings_.keyframe_survival * static_cast<float>(keyframe_tracks_);
  return worn || medianParallax() > settings_.keyframe_parallax;
}

void Frontend::Impl::markKeyframe(Stamp stamp) {
  has_keyframe_ = true;
  keyframe_stamp_ = stamp;
  keyframe_tracks_ = static_cast<int>(tracks_.size());
  keyframe_rotation_known_ = true;
  R_keyframe_cur_.setIdentity();
  for (Track& track : tracks_) {
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      track.in_keyframe[c] = track.live[c];
      track.keyframe_bearing[c] = track.bearing[c];
    }
  }
}

}  // namespace swiftlet
