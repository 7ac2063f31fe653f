#pragma once
// Windows and tracks of landmarks that are placed by hand, seen by an ideal pinhole camera.

#include <memory>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "mesher/mesh_stage.hpp"

namespace swiftlet::test {

constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr double kFocal = 400;

/// Camera 0 at the body, looking along the body's z axis.
inline Rig pinholeRig() {
  Rig rig;
  rig.camera_count = 1;
  rig.camera[0] = CameraModel(CameraKind::kPinholeRadtan, kWidth, kHeight,
                              {kFocal, kFocal, 0.5 * kWidth, 0.5 * kHeight}, Eigen::Vector4d::Zero());
  return rig;
}

/// A frame's window and tracks; landmarks out of sight are in the window alone.
struct MeshScene {
  std::unique_ptr<SmoothedWindow> window = std::make_unique<SmoothedWindow>();
  std::unique_ptr<TrackedFrame> tracks = std::make_unique<TrackedFrame>();

  MeshScene(const Rig& rig, const SE3& T_world_body, std::uint64_t index) {
    window->started = true;
    window->newest.T_world_body = T_world_body;
    window->calibration.T_body_cam = rig.T_body_cam;
    const Stamp stamp{static_cast<std::int64_t>(index) * 50'000'000};
    static_cast<void>(window->poses.tryPushBack({stamp, index, true, T_world_body, {}}));
    tracks->stamp = stamp;
    tracks->index = index;
    tracks->keyframe = true;
    rig_ = rig;
  }

  void add(TrackId id, const Eigen::Vector3d& p_world, bool tracked = true,
           double inverse_depth_sigma = 0.001) {
    static_cast<void>(window->landmarks.tryPushBack({id, p_world, inverse_depth_sigma, 5}));
    const SE3 T_cam_world = (window->poses.back().T_world_body * rig_.T_body_cam[0]).inverse();
    Eigen::Vector2d pixel;
    if (!tracked || !rig_.camera[0].project(T_cam_world * p_world, pixel) ||
        !rig_.camera[0].inImage(pixel, 0))
      return;
    TrackedFeature feature;
    feature.id = id;
    feature.seen[0] = true;
    feature.pixel[0] = pixel.cast<float>();
    static_cast<void>(tracks->features.tryPushBack(feature));
  }

  [[nodiscard]] MeshInput input() const {
    MeshInput input;
    input.window = window.get();
    input.tracks = tracks.get();
    return input;
  }

 private:
  Rig rig_;
};

}  // namespace swiftlet::test
