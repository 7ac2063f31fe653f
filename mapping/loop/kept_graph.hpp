#pragma once
// What a later flight needs to know where it is in this one's map: the poses of the graph with what their
// images showed, the odometry between them and the loops. LoopStage makes it and takes it in; files:
// firmware_host/outputs/map_files.
//
// Poses are those of the body that flew, in the map's frame (z up). T_body_cam tells where its camera 0 was:
// a vehicle that carries it elsewhere counts the poses as those of its own body at the same camera.
// Memory: 100 bytes a feature, some 30 kB a node.

#include <cstdint>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"
#include "mapping/place/place_keyframe.hpp"
#include "mapping/pose_graph/gravity_factor.hpp"
#include "mapping/pose_graph/pose_tangent.hpp"

namespace swiftlet {

struct KeptNode {
  Stamp stamp;  ///< of the clock of its own flight
  SE3 T_map_body;
  Tilt tilt;
  /// By the odometry, to the node before it. Else the first of a piece that loops alone join to the others:
  /// then of the solved graph. Without meaning for the first node.
  bool linked = false;
  SE3 T_previous_this;
  PoseMatrix<SE3> covariance = PoseMatrix<SE3>::Zero();  ///< of it, perturbed on the right
  std::vector<PlaceFeature> features;                    ///< empty: its images were gone
};

/// A loop that was believed.
struct KeptLoop {
  std::uint32_t from = 0;  ///< nodes, from < to
  std::uint32_t to = 0;
  SE3 T_from_to;
  PoseMatrix<SE3> covariance = PoseMatrix<SE3>::Zero();
};

struct KeptGraph {
  CameraModel camera;  ///< camera 0 of the flight, of the first of several
  SE3 T_body_cam;
  std::vector<KeptNode> nodes;
  std::vector<KeptLoop> loops;
};

/// What a flight does with a kept map.
enum class KeptUse : std::uint8_t {
  kLocalize,  ///< its poses stay where they are
  kExtend,    ///< the flight's nodes and loops become part of it, and move it
};

}  // namespace swiftlet
