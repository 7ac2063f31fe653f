#pragma once
// Poses joined by measured relative poses, in the plane and in space.
//
// Cost of a graph, g2o's (chi2 = 2 x cost): 1/2 sum e^T Omega e, with T = T_from_to^-1 (T_from^-1 T_to) and
//   space:  e = (2 vec(q(T)) with q.w >= 0, p(T)),   plane:  e = (angle(T), p(T)),
// rotation first as in smoother/state.hpp. The information is in radians and metres. A g2o file holds that of
// vec(q), translation first; g2o_text.hpp converts it. docs/pose_graph.md.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "estimator/geometry/se2.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

template <typename Pose>
struct PoseSpace;

template <>
struct PoseSpace<SE2> {
  static constexpr int kDof = 3;
  static constexpr int kRotationDof = 1;
};

template <>
struct PoseSpace<SE3> {
  static constexpr int kDof = 6;
  static constexpr int kRotationDof = 3;
};

template <typename Pose>
struct RelativePose {
  static constexpr int kDof = PoseSpace<Pose>::kDof;
  using Information = Eigen::Matrix<double, kDof, kDof>;

  std::uint32_t from = 0;  ///< index in PoseGraph::poses
  std::uint32_t to = 0;
  Pose T_from_to;
  Information information = Information::Identity();  ///< (rotation, translation), 1/rad^2, 1/m^2
};

/// The measured vertical of a pose in space (gravity_factor.hpp).
struct GravityFactor {
  Eigen::Vector3d up_body = Eigen::Vector3d::UnitZ();     ///< unit
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< 1/rad^2, in the body's axes; 0: no factor
};

template <typename Pose>
struct PoseGraph {
  std::vector<Pose> poses;  ///< T_map_body
  std::vector<RelativePose<Pose>> edges;
};

}  // namespace swiftlet
