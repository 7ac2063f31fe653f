// After the solve: what did not fit, and what others are told.

#include <cmath>

#include "estimator/smoother/smoother.hpp"

namespace swiftlet {
namespace {

constexpr int kMaxRejections = 3;  // solves in which a landmark may fail to fit

}  // namespace

// newest_only: single sightings of the newest frame. Otherwise: landmarks that fit nowhere.
void Smoother::rejectOutliers(double threshold, bool newest_only) {
  const std::uint8_t newest_slot = order_.back();
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    if (landmark_ids_[i] == 0) continue;
    Landmark& landmark = landmarks_[i];
    if (newest_only) {
      if (in_system_[i] == 0 || landmark.sightings.empty()) continue;
      if (landmark.sightings.back().slot != newest_slot) continue;
      Sighting& sighting = landmark.sightings.back();
      for (std::size_t c = 0; c < rig_.camera_count; ++c) {
        CameraSighting& view = sighting.camera[c];
        if (!view.used) continue;
        Eigen::Vector2d r;
        if (!reprojectionResidual(view, rig_poses_[newest_slot].current[c], landmark.point, r) ||
            r.squaredNorm() > threshold * threshold) {
          view.used = false;
        }
      }
      if (!sighting.camera[0].used && !sighting.camera[1].used) {
        landmark.sightings.popBack();
        if (++landmark.rejections >= kMaxRejections) discardLandmark(landmark);
      }
      continue;
    }
    const bool tried = landmark.sightings.size() >= 2;
    const bool bad =
        tried && (in_system_[i] == 0 ||
                  meanSquaredResidual(rig_poses_, landmark.views(), landmark.point) > threshold * threshold);
    if (bad && ++landmark.rejections >= kMaxRejections) {
      discardLandmark(landmark);
      in_system_[i] = 0;
    } else if (bad && landmark.extra == kNoExtra) {
      landmark.point.triangulated = false;
    }
  }
}

void Smoother::updateStatistics() {
  const std::uint8_t slot = order_.back();
  double sum = 0;
  int views = 0;
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    // An explicit landmark may have lost its last sighting.
    if (in_system_[i] == 0 || landmarks_[i].sightings.empty()) continue;
    const Landmark& landmark = landmarks_[i];
    ++statistics_.landmarks;
    const int count = landmark.viewCount();
    sum += meanSquaredResidual(rig_poses_, landmark.views(), landmark.point) * count;
    views += count;
    const Sighting& last = landmark.sightings.back();
    if (last.slot != slot) continue;
    const bool both = last.camera[0].used && last.camera[1].used;
    ++(both ? statistics_.inliers_stereo : statistics_.inliers_mono);
  }
  if (views > 0) statistics_.reprojection_rms = settings_.pixel_sigma * std::sqrt(sum / views);
  WindowState& state = states_[slot];
  statistics_.keyframe = state.keyframe;
  statistics_.at_rest = state.at_rest;
  state.statistics = statistics_;
}

void Smoother::window(SmoothedWindow& out) const {
  out.poses.clear();
  out.landmarks.clear();
  for (const std::uint8_t slot : order_) {
    const WindowState& s = states_[slot];
    static_cast<void>(out.poses.tryPushBack({s.stamp, s.frame_index, s.keyframe, s.x.T_world_body}));
  }
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    const Landmark& landmark = landmarks_[i];
    if (in_system_[i] == 0 || landmark.point.inverse_depth <= 0) continue;
    static_cast<void>(out.landmarks.tryPushBack({landmark.id - 1, landmark.point.position(),
                                                 landmark.point.inverse_depth_sigma,
                                                 static_cast<int>(landmark.sightings.size())}));
  }
}

}  // namespace swiftlet
