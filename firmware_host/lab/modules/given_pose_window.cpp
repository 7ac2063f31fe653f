#include "firmware_host/lab/modules/given_pose_window.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/triangulation.hpp"
#include "estimator/smoother/keyframe_choice.hpp"

namespace swiftlet {
namespace {

// px: six sigma of the tracks' noise, and the effect of some milliradians of error in the truth.
constexpr double kMaxReprojection = 3.0;
// A landmark may lose up to this share of its sightings before it is rejected as a whole.
constexpr double kMaxShareLeftOut = 1.0 / 3.0;
// Depth uncertain by more than a third: within three sigma of infinity.
constexpr double kMaxRelativeDepthSigma = 1.0 / 3.0;
// px: search radius around a predicted landmark, including its own error and the poses'.
constexpr float kGate = 8.0F;
// As in the smoother: this many of the newest keyframes behind the recent frames are never removed.
constexpr std::size_t kProtectedKeyframes = 5;

/// Index of the bearing with the largest angular error to the point.
std::size_t worstSighting(const Eigen::Vector3d& point, const std::vector<Eigen::Vector3d>& bearings,
                          const std::vector<SE3>& poses) {
  std::size_t worst = 0;
  double lowest = 2;
  for (std::size_t i = 0; i < bearings.size(); ++i) {
    const double cosine = (point - poses[i].translation).normalized().dot(poses[i].rotation * bearings[i]);
    if (cosine >= lowest) continue;
    lowest = cosine;
    worst = i;
  }
  return worst;
}

}  // namespace

GivenPoseWindow::GivenPoseWindow(const Rig& rig, const GivenPoseSettings& settings)
    : rig_(rig), settings_(settings) {
  window_.calibration.camera_to_imu_shift = rig.camera_to_imu_shift;
  window_.calibration.readout = rig.readout;
  window_.calibration.T_body_cam = rig.T_body_cam;
}

void GivenPoseWindow::startEpoch() {
  ++epoch_;
  states_.clear();
  landmarks_.clear();
  const CalibrationEstimate calibration = window_.calibration;
  window_ = {};
  window_.calibration = calibration;
  window_.epoch = epoch_;
}

void GivenPoseWindow::predict(const SE3& T_world_body, FrontendPrediction& prediction) const {
  prediction.has_rotation = !states_.empty();
  prediction.landmarks.clear();
  if (states_.empty()) return;
  prediction.R_body_prev_body_cur = states_.back().T_world_body.rotation.conjugate() * T_world_body.rotation;
  for (const WindowLandmark& landmark : window_.landmarks) {
    PredictedLandmark predicted;
    predicted.id = landmark.id;
    predicted.gate = kGate;
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      const SE3 T_cam_world = (T_world_body * rig_.T_body_cam[c]).inverse();
      Eigen::Vector2d pixel;
      if (!rig_.camera[c].project(T_cam_world * landmark.p_world, pixel) || !rig_.camera[c].inImage(pixel)) {
        continue;
      }
      predicted.visible[c] = true;
      predicted.pixel[c] = pixel.cast<float>();
    }
    if (predicted.visible[0] || predicted.visible[1]) {
      static_cast<void>(prediction.landmarks.tryPushBack(predicted));
    }
  }
}

void GivenPoseWindow::add(const TrackedFrame& tracked, const SE3& T_world_body) {
  const Stamp stamp = tracked.stamp + rig_.camera_to_imu_shift;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  if (!states_.empty()) {
    velocity = (T_world_body.translation - states_.back().T_world_body.translation) /
               (stamp - states_.back().stamp).seconds();
  }
  states_.push_back({stamp, tracked.index, tracked.keyframe, T_world_body, {}});
  addViews(tracked, T_world_body);
  trim();
  window_.started = true;
  window_.newest.stamp = stamp;
  window_.newest.epoch = epoch_;
  window_.newest.health = Health::kGood;
  window_.newest.T_world_body = T_world_body;
  window_.newest.v_world_body = velocity;
  writeWindow();
}

void GivenPoseWindow::addViews(const TrackedFrame& tracked, const SE3& T_world_body) {
  for (const TrackedFeature& feature : tracked.features) {
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      Eigen::Vector3d bearing;
      if (!feature.seen[c] || !feature.pixel[c].allFinite() ||
          !rig_.camera[c].unproject(feature.pixel[c].cast<double>(), bearing)) {
        continue;
      }
      Landmark& landmark = landmarks_[feature.id];
      landmark.views.push_back({tracked.index, bearing, T_world_body * rig_.T_body_cam[c]});
      landmark.last_frame = tracked.index;
      landmark.changed = true;
    }
  }
}

void GivenPoseWindow::trim() {
  const auto recent = static_cast<std::size_t>(settings_.max_recent);
  for (std::size_t k = 0; k + recent < states_.size();) {
    if (states_[k].keyframe) {
      ++k;
    } else {
      dropState(k);
    }
  }
  while (states_.size() > recent) {
    const std::size_t keyframes = states_.size() - recent;
    const bool too_old = (states_.back().stamp - states_.front().stamp).seconds() > settings_.horizon;
    if (!too_old && keyframes <= static_cast<std::size_t>(settings_.max_keyframes)) break;
    dropState(too_old ? 0 : chooseKeyframeToDrop(keyframes - std::min(kProtectedKeyframes, keyframes - 1)));
  }
}

std::size_t GivenPoseWindow::chooseKeyframeToDrop(std::size_t candidates) const {
  const auto recent = static_cast<std::size_t>(settings_.max_recent);
  const std::uint64_t oldest_recent = states_[states_.size() - recent].frame_index;
  std::map<std::uint64_t, std::pair<int, int>> seen_shared;
  for (const auto& [id, landmark] : landmarks_) {
    std::uint64_t counted = 0;
    for (const View& view : landmark.views) {
      if (view.frame_index + 1 == counted) continue;  // its other camera
      counted = view.frame_index + 1;
      auto& [seen, shared] = seen_shared[view.frame_index];
      ++seen;
      if (landmark.last_frame >= oldest_recent) ++shared;
    }
  }
  std::vector<KeyframeInWindow> window;
  for (const WindowPose& state : states_) {
    const auto [seen, shared] = seen_shared[state.frame_index];
    window.push_back({state.T_world_body, state.keyframe, seen, shared});
  }
  return keyframeToDrop(window, candidates);
}

void GivenPoseWindow::dropState(std::size_t position) {
  const WindowPose state = states_[position];
  states_.erase(states_.begin() + static_cast<std::ptrdiff_t>(position));
  if (state.keyframe && settings_.keep_sightings) return;
  for (auto at = landmarks_.begin(); at != landmarks_.end();) {
    Landmark& landmark = at->second;
    const auto removed = std::erase_if(
        landmark.views, [&](const View& view) { return view.frame_index == state.frame_index; });
    landmark.changed = landmark.changed || removed > 0;
    at = landmark.views.empty() ? landmarks_.erase(at) : std::next(at);
  }
}

GivenPoseWindow::Point GivenPoseWindow::locate(const Landmark& landmark) {
  Point point;
  std::vector<Eigen::Vector3d> bearings;
  std::vector<SE3> poses;
  for (const View& view : landmark.views) {
    bearings.push_back(view.bearing);
    poses.push_back(view.T_world_cam);
  }
  if (bearings.size() < 2) return point;
  const double focal = rig_.camera[0].focal();
  TriangulationSettings settings;
  settings.max_error = kMaxReprojection / focal;
  const auto least = std::max<std::size_t>(
      2, static_cast<std::size_t>(std::ceil((1 - kMaxShareLeftOut) * static_cast<double>(bearings.size()))));
  Triangulation found = triangulate(bearings, poses, settings);
  while (found.state == TriangulationState::kOutlier && bearings.size() > least) {
    const auto worst = static_cast<std::ptrdiff_t>(worstSighting(found.point, bearings, poses));
    bearings.erase(bearings.begin() + worst);
    poses.erase(poses.begin() + worst);
    ++counters_.sightings_left_out;
    found = triangulate(bearings, poses, settings);
  }
  if (found.state == TriangulationState::kNoParallax) ++counters_.no_parallax;
  if (!found.valid()) {
    if (found.state != TriangulationState::kNoParallax) ++counters_.no_fit;
    return point;
  }
  const double bearing_sigma = settings_.pixel_sigma / focal;
  const Eigen::Vector3d ray = poses[0].rotation * bearings[0];
  const double depth = (found.point - poses[0].translation).norm();
  const double depth_sigma = bearing_sigma * std::sqrt(ray.dot(found.information.inverse() * ray));
  if (!(depth_sigma < kMaxRelativeDepthSigma * depth)) {
    ++counters_.no_parallax;
    return point;
  }
  ++counters_.triangulated;
  return {true, found.point, depth_sigma / (depth * depth)};
}

void GivenPoseWindow::writeWindow() {
  window_.poses.clear();
  window_.landmarks.clear();
  for (const WindowPose& state : states_) static_cast<void>(window_.poses.tryPushBack(state));
  std::vector<const Landmarks::value_type*> valid;
  for (auto& entry : landmarks_) {
    Landmark& landmark = entry.second;
    if (landmark.changed) landmark.point = locate(landmark);
    landmark.changed = false;
    if (landmark.point.valid) valid.push_back(&entry);
  }
  // As in the smoother: the landmarks not seen for longest are removed first.
  if (valid.size() > kMaxLandmarks) {
    std::stable_sort(valid.begin(), valid.end(), [](const auto* a, const auto* b) {
      return a->second.last_frame > b->second.last_frame;
    });
    valid.resize(kMaxLandmarks);
  }
  for (const auto* entry : valid) {
    const Landmark& landmark = entry->second;
    int sightings = 0;
    std::uint64_t counted = 0;
    for (const View& view : landmark.views) {
      sightings += view.frame_index + 1 == counted ? 0 : 1;
      counted = view.frame_index + 1;
    }
    static_cast<void>(window_.landmarks.tryPushBack(
        {entry->first, landmark.point.p_world, landmark.point.inverse_depth_sigma, sightings}));
  }
}

}  // namespace swiftlet
