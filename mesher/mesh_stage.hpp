#pragma once
// The stage of the thread `mesh`: computes the frame mesh and the horizon mesh from a solved window and its
// newest frame, and optionally the planes in them.
//
// Every step updates both meshes; a schedule that is late skips frames. Features of camera 0 whose landmark
// is in the window are lifted to 3D; all tracked features span the hull. A new epoch of the window starts a
// new mesh. Bad input is skipped and counted: landmarks that are not finite or duplicate, features that are
// duplicate or outside the image, frames with fewer than three points, and pose jumps. With planes: at
// keyframes planes are searched in the horizon mesh as given by the landmarks. The output meshes are then
// flattened onto the known planes and folded where two planes meet.
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
  const SmoothedWindow* window = nullptr;  ///< solved with the frame; its newest pose is that of the frame
  const TrackedFrame* tracks = nullptr;    ///< of the same frame
  ImageView image;                         ///< camera 0, for grey values; may be empty
  ImageView labels;                        ///< in camera 0's raw geometry; may be empty
};

struct MeshPlanes {
  bool enabled = false;
  double surface_sigma = 0.01;  ///< m, standard deviation of a point's distance from its plane
};

struct MeshCounters {
  std::uint64_t frames = 0;          ///< frames that gave a mesh
  std::uint64_t invalid_frames = 0;  ///< without pose, or window and tracks of different frames
  std::uint64_t pose_jumps = 0;      ///< frames skipped because the pose jumped
  std::uint64_t too_few_points = 0;  ///< frames with fewer than three lifted features
  std::uint64_t bad_landmarks = 0;   ///< not finite, or a duplicate id
  std::uint64_t bad_features = 0;    ///< not finite, outside the image, or a duplicate id
  std::uint64_t epochs = 0;          ///< meshes started
};

class MeshStage {
 public:
  MeshStage(const Rig& rig, const HorizonLimits& limits, const MeshPlanes& planes = {});

  /// kInvalidInput: the frame is skipped and counted, the meshes are unchanged. kDegenerate: the frame mesh
  /// is empty.
  Status step(const MeshInput& input);
  void reset();

  /// The meshes of the last step, world axes.
  void frameMesh(LocalMesh& out) const;
  void horizonMesh(LocalMesh& out) const;
  [[nodiscard]] const FrameMesh& frame() const { return frame_; }
  [[nodiscard]] const HorizonMesh& horizon() const { return horizon_; }
  /// Hull of the tracked features of camera 0 in the last step, including those of unknown depth [px].
  [[nodiscard]] const HullPoints& hull() const { return hull_; }
  /// The planes that the last step found; null if it did not search for them.
  [[nodiscard]] const PlaneReport* newPlanes() const { return looked_ ? &planes_->report : nullptr; }
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
    LocalMesh frame, horizon;  ///< flattened onto planes
  };

  Rig rig_;
  HullPoints features_, hull_;
  FixedVector<TrackId, kMaxFeatures> ids_;  // scratch
  LandmarkLookup landmarks_;
  FrameMesh::Points points_;
  FrameMesh frame_;
  HorizonMesh horizon_;
  double surface_sigma_ = 0;
  std::unique_ptr<Planes> planes_;  ///< null if disabled
  bool looked_ = false;
  bool begun_ = false;
  std::uint32_t epoch_ = 0;
  Stamp stamp_;
  std::uint64_t frame_index_ = 0;
  SE3 T_world_body_, T_world_cam_;
  MeshCounters counters_;
};

}  // namespace swiftlet
