#include "mesher/mesh_stage.hpp"

#include <algorithm>
#include <cmath>

#include "mesher/plane_drawing.hpp"
#include "mesher/plane_folds.hpp"

namespace swiftlet {
namespace {

// If the vehicle moves between two frames by more than this speed allows and by more than this distance, the
// estimate has jumped.
constexpr double kMaxSpeed = 50;  // m/s
constexpr double kMaxStep = 0.5;  // m

template <typename Vertices, typename Faces>
void copyMesh(const Vertices& vertices, const Faces& faces, LocalMesh& out) {
  out.vertices.clear();
  out.faces.clear();
  for (const MeshVertex& vertex : vertices) static_cast<void>(out.vertices.tryPushBack(vertex));
  for (const HorizonMesh::Face& face : faces) {
    const std::uint32_t last = std::max({face.vertex[0], face.vertex[1], face.vertex[2]});
    if (last < out.vertices.size()) static_cast<void>(out.faces.tryPushBack({face.vertex, face.label}));
  }
}

}  // namespace

MeshStage::MeshStage(const Rig& rig, const HorizonLimits& limits, const MeshPlanes& planes)
    : rig_(rig),
      horizon_(limits),
      surface_sigma_(planes.surface_sigma),
      planes_(planes.enabled ? std::make_unique<Planes>() : nullptr) {}

void MeshStage::reset() {
  begun_ = false;
  looked_ = false;
  horizon_.clear();
  if (planes_) {
    planes_->finder.reset();
    planes_->report.planes.clear();
    planes_->report.points.clear();
    for (LocalMesh* mesh : {&planes_->frame, &planes_->horizon}) {
      mesh->vertices.clear();
      mesh->faces.clear();
    }
  }
  points_.clear();
  hull_.clear();
  frame_.build(points_, {});
}

Status MeshStage::check(const MeshInput& input) {
  const SmoothedWindow* window = input.window;
  if (window == nullptr || input.tracks == nullptr || !window->started || window->poses.empty() ||
      window->poses.back().frame_index != input.tracks->index) {
    ++counters_.invalid_frames;
    return {StatusCode::kInvalidInput, "window and tracks are from different frames: no mesh"};
  }
  const WindowPose& pose = window->poses.back();
  if (!pose.T_world_body.translation.allFinite() || !pose.T_world_body.rotation.coeffs().allFinite()) {
    ++counters_.invalid_frames;
    return {StatusCode::kInvalidInput, "pose is not finite: no mesh"};
  }
  if (!begun_ || window->epoch != epoch_) {
    reset();
    begun_ = true;
    epoch_ = window->epoch;
    ++counters_.epochs;
  } else {
    const double moved = (pose.T_world_body.translation - T_world_body_.translation).norm();
    const double seconds = std::abs((pose.stamp - stamp_).seconds());
    T_world_body_ = pose.T_world_body;
    stamp_ = pose.stamp;
    if (moved > kMaxStep + kMaxSpeed * seconds) {
      ++counters_.pose_jumps;
      return {StatusCode::kInvalidInput, "pose jumped: no mesh"};
    }
  }
  T_world_body_ = pose.T_world_body;
  stamp_ = pose.stamp;
  frame_index_ = pose.frame_index;
  T_world_cam_ = pose.T_world_body * window->calibration.T_body_cam[0];
  return okStatus();
}

/// Collects the frame's features for the hull, and lifts those with a landmark.
void MeshStage::lift(const MeshInput& input) {
  points_.clear();
  features_.clear();
  ids_.clear();
  const SE3 T_cam_world = T_world_cam_.inverse();
  const CameraModel& camera = rig_.camera[0];
  for (const TrackedFeature& feature : input.tracks->features) {
    if (feature.seen[0]) static_cast<void>(ids_.tryPushBack(feature.id));
  }
  std::sort(ids_.begin(), ids_.end());
  for (const TrackedFeature& feature : input.tracks->features) {
    if (!feature.seen[0]) continue;
    const Eigen::Vector2f& pixel = feature.pixel[0];
    const auto same = std::equal_range(ids_.begin(), ids_.end(), feature.id);
    if (!pixel.allFinite() || !camera.inImage(pixel.cast<double>(), 0) || same.second - same.first > 1) {
      ++counters_.bad_features;
      continue;
    }
    static_cast<void>(features_.tryPushBack(pixel));
    const WindowLandmark* landmark = landmarks_.find(feature.id);
    if (landmark == nullptr) continue;
    const Eigen::Vector3d p = T_cam_world * landmark->p_world;
    const double distance = p.norm();
    FramePoint point;
    point.id = feature.id;
    point.pixel = pixel;
    point.p_cam = p.cast<float>();
    point.relative_sigma = static_cast<float>(landmark->inverse_depth_sigma * distance);
    if (!input.image.empty()) {
      const int x = std::clamp(static_cast<int>(std::lround(pixel.x())), 0, input.image.width - 1);
      const int y = std::clamp(static_cast<int>(std::lround(pixel.y())), 0, input.image.height - 1);
      point.grey = input.image.row(y)[x];
    }
    static_cast<void>(points_.tryPushBack(point));
  }
}

Status MeshStage::step(const MeshInput& input) {
  looked_ = false;
  if (const Status status = check(input); !status.ok()) return status;
  counters_.bad_landmarks += static_cast<std::uint64_t>(landmarks_.fill(*input.window));
  lift(input);
  convexHull(features_, hull_);
  frame_.build(points_, input.labels);
  horizon_.update(frame_, landmarks_, rig_.camera[0], T_world_cam_);
  if (planes_) findPlanes(input);
  if (frame_.faces().empty()) {
    ++counters_.too_few_points;
    return {StatusCode::kDegenerate, "no three features with a depth: no mesh of this frame"};
  }
  ++counters_.frames;
  return okStatus();
}

void MeshStage::findPlanes(const MeshInput& input) {
  const SmoothedWindow& window = *input.window;
  PlaneReport& report = planes_->report;
  copyHorizon(planes_->horizon);
  copyFrame(planes_->frame);
  if (input.tracks->keyframe) {
    // If the finder refuses its input, its report is empty and its counters record it.
    looked_ = planes_->finder.step(planes_->horizon, window, report).ok();
  }
  for (LocalMesh* mesh : {&planes_->horizon, &planes_->frame}) {
    drawOntoPlanes(report, window, surface_sigma_, *mesh);
    foldAtPlanes(report, window, *mesh);
  }
}

void MeshStage::frameMesh(LocalMesh& out) const {
  if (planes_) {
    out = planes_->frame;
  } else {
    copyFrame(out);
  }
}

void MeshStage::horizonMesh(LocalMesh& out) const {
  if (planes_) {
    out = planes_->horizon;
  } else {
    copyHorizon(out);
  }
}

void MeshStage::copyFrame(LocalMesh& out) const {
  out.epoch = epoch_;
  out.stamp = stamp_;
  out.frame_index = frame_index_;
  out.vertices.clear();
  out.faces.clear();
  for (const FramePoint& point : frame_.points()) {
    const Eigen::Vector3d p = T_world_cam_ * point.p_cam.cast<double>();
    static_cast<void>(out.vertices.tryPushBack({point.id, p.cast<float>(), point.grey}));
  }
  for (const FrameFace& face : frame_.faces()) {
    if (face.verdict != FaceVerdict::kKept) continue;
    static_cast<void>(out.faces.tryPushBack({{face.point[0], face.point[1], face.point[2]}, face.label}));
  }
}

void MeshStage::copyHorizon(LocalMesh& out) const {
  out.epoch = epoch_;
  out.stamp = stamp_;
  out.frame_index = frame_index_;
  copyMesh(horizon_.vertices(), horizon_.faces(), out);
}

}  // namespace swiftlet
