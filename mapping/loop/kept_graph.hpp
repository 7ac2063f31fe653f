#pragma once
// The part of a map that a later flight needs to locate itself: poses of the graph with the features of their
// images, the odometry between them, and the loops. LoopStage writes and reads it; files are in
// firmware_host/outputs/map_files.
//
// Poses are those of the body that flew, in the map's frame (z up). T_body_cam is the pose of its camera 0. A
// vehicle with the camera elsewhere converts the poses to those of its own body at the same camera pose.
// Memory: 72 bytes a feature, some 30 kB a node.

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
  /// True: the odometry joins the node to the one before. False: the first node of a piece that only loops
  /// join to the others; T_previous_this is then of the solved graph. Not used for the first node.
  bool linked = false;
  SE3 T_previous_this;
  PoseMatrix<SE3> covariance = PoseMatrix<SE3>::Zero();  ///< of T_previous_this, perturbed on the right
  std::vector<PlaceFeature> features;                    ///< empty if its images were not available
};

/// An accepted loop.
struct KeptLoop {
  std::uint32_t from = 0;  ///< index of the node; from < to
  std::uint32_t to = 0;
  SE3 T_from_to;
  PoseMatrix<SE3> covariance = PoseMatrix<SE3>::Zero();
};

struct KeptGraph {
  CameraModel camera;  ///< camera 0 of the flight, or of the first of several flights
  SE3 T_body_cam;
  std::vector<KeptNode> nodes;
  std::vector<KeptLoop> loops;
};

/// How a flight uses a kept map.
enum class KeptUse : std::uint8_t {
  kLocalize,  ///< the poses of the map are held
  kExtend,    ///< nodes and loops of the flight become part of the map and move it
};

}  // namespace swiftlet
