#pragma once
// The stage of the thread `mesh`: from a solved window and its newest frame to the frame's mesh, the mesh
// over the horizon and, where they are wanted, the planes in it.
//
// Both are brought up to date at every step; an executor in a hurry leaves frames out. Features of camera 0
// whose landmark is in the window are lifted; all tracked ones span the hull. A new epoch of the window
// starts a new mesh. Bad input is skipped and counted: landmarks that are not finite or come twice, features
// that come twice or lie outside the image, frames with fewer than three points, and a pose that jumped.
// With planes: at keyframes they are looked for in the mesh over the horizon as the landmarks give it; the
// meshes that are given out are drawn onto those known by then, and folded where two meet.
// Frames: world, body, camera 0; metres; raw pixels.
// Memory: 0.9 MiB, 0.7 MiB more with planes, all reserved by the constructor. Cost: docs/performance.md.

#include <array>
#include <cstdint>
#include <memory>

#include "estimator/camera/rig.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "mesher/convex_hull.hpp"
#include "mesher/frame_mesh.hpp"
#include "mesher/horizon_mesh.hpp"
#include "mesher/plane_finder.hpp"

namespace swiftlet {

struct MeshInput {
  const SmoothedWindow* window = nullptr;  ///< after the frame's solve: its newest pose is the frame's
  const TrackedFrame* tracks = nullptr;    ///< of the same frame
  ImageView image;                         ///< camera 0, for grey values; may be empty
  ImageView labels;                        ///< in camera 0's raw geometry; may be empty
};

struct MeshPlanes {
  bool enabled = false;
  double surface_sigma = 0.01;  ///< m, by which a surface is off its plane
};

struct MeshCounters {
  std::uint64_t frames = 0;          ///< that gave a mesh
  std::uint64_t invalid_frames = 0;  ///< no pose, or window and tracks of different frames
  std::uint64_t pose_jumps = 0;      ///< frames skipped for it
  std::uint64_t too_few_points = 0;  ///< frames without three lifted features
  std::uint64_t bad_landmarks = 0;   ///< not finite, or an id that came before
  std::uint64_t bad_features = 0;    ///< not finite, outside the image, or an id that came before
  std::uint64_t epochs = 0;          ///< meshes begun
};

class MeshStage {
 public:
  MeshStage(const Rig& rig, const HorizonLimits& limits, const MeshPlanes& planes = {});

  /// kInvalidInput: skipped and counted, the meshes are as they were. kDegenerate: no frame mesh, and it is
  /// empty.
  Status step(const MeshInput& input);
  void reset();

  /// As of the last step, world axes.
  void frameMesh(LocalMesh& out) const;
  void horizonMesh(LocalMesh& out) const;
  [[nodiscard]] const FrameMesh& frame() const { return frame_; }
  [[nodiscard]] const HorizonMesh& horizon() const { return horizon_; }
  /// Of the last step: the tracked features of camera 0, those without a known depth too [px].
  [[nodiscard]] const HullPoints& hull() const { return hull_; }
  /// The planes that the last step found; null unless it looked for them.
  [[nodiscard]] const PlaneReport* newPlanes() const { return looked_ ? &planes_->report : nullptr; }
  /// Null without planes.
  [[nodiscard]] const PlaneCounters* planeCounters() const {
    return planes_ ? &planes_->finder.counters() : nullptr;
  }
  [[nodiscard]] const MeshCounters& counters() const { return counters_; }

 private:
  [[nodiscard]] Status check(const MeshInput& input);
  void lift(const MeshInput& input);
  void findPlanes(const MeshInput& input);
  void copyFrame(LocalMesh& out) const;
  void copyHorizon(LocalMesh& out) const;

  struct Planes {
    PlaneFinder finder;
    PlaneReport report;
    LocalMesh frame, horizon;  ///< drawn
  };

  Rig rig_;
  HullPoints features_, hull_;
  FixedVector<TrackId, kMaxFeatures> ids_;  // scratch
  LandmarkLookup landmarks_;
  FrameMesh::Points points_;
  FrameMesh frame_;
  HorizonMesh horizon_;
  double surface_sigma_ = 0;
  std::unique_ptr<Planes> planes_;  ///< null: not wanted
  bool looked_ = false;
  bool begun_ = false;
  std::uint32_t epoch_ = 0;
  Stamp stamp_;
  std::uint64_t frame_index_ = 0;
  SE3 T_world_body_, T_world_cam_;
  MeshCounters counters_;
};

}  // namespace swiftlet
