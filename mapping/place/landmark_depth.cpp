#include <algorithm>
#include <cmath>
#include <numeric>

#include "mapping/place/feature_depth.hpp"

namespace swiftlet {

Status LandmarkDepth::fill(const SmoothedWindow& window, const SE3& T_body_cam0, PlaceKeyframe& keyframe,
                           std::size_t& found) {
  found = 0;
  if (!window.started) return {StatusCode::kNotReady, "landmark depth: the smoother has not started"};
  if (window.epoch != keyframe.epoch) {
    return {StatusCode::kInvalidInput, "landmark depth: window and keyframe are of different epochs"};
  }
  const WindowPose* pose = std::find_if(window.poses.begin(), window.poses.end(),
                                        [&](const WindowPose& p) { return p.frame_index == keyframe.index; });
  if (pose == window.poses.end()) {
    return {StatusCode::kNotReady, "landmark depth: the window does not hold the keyframe"};
  }
  const SE3 T_cam_world = (pose->T_world_body * T_body_cam0).inverse();
  const auto end = order_.begin() + static_cast<std::ptrdiff_t>(window.landmarks.size());
  std::iota(order_.begin(), end, std::uint16_t{0});
  std::sort(order_.begin(), end, [&](std::uint16_t a, std::uint16_t b) {
    return window.landmarks[a].id < window.landmarks[b].id;
  });
  for (PlaceFeature& feature : keyframe.features) {
    if (!feature.has_landmark) continue;
    const auto at = std::lower_bound(order_.begin(), end, feature.landmark, [&](std::uint16_t i, TrackId id) {
      return window.landmarks[i].id < id;
    });
    if (at == end || window.landmarks[*at].id != feature.landmark) continue;
    const WindowLandmark& landmark = window.landmarks[*at];
    const double distance = (T_cam_world * landmark.p_world).norm();
    if (!(distance > 0) || !std::isfinite(distance) || !(landmark.inverse_depth_sigma > 0)) continue;
    const double sigma = std::max(landmark.inverse_depth_sigma, min_relative_sigma_ / distance);
    ++found;
    if (feature.inverse_depth_sigma > 0 && feature.inverse_depth_sigma < sigma) continue;
    feature.inverse_depth = static_cast<float>(1.0 / distance);
    feature.inverse_depth_sigma = static_cast<float>(sigma);
  }
  return okStatus();
}

}  // namespace swiftlet
