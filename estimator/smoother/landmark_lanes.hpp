#pragma once
// One landmark linearized at the states that see it and eliminated, four states at a time.
//
// For state i with Jacobians J_i (pose) and P_i (point), both of all its views, whitened and weighted:
//   A_i = J_i^T J_i,  B_i = J_i^T P_i,  a_i = J_i^T r_i,  c = sum P_i^T r_i,  C = sum P_i^T P_i + prior = L
//   L^T.
// Eliminating the point leaves, with Y_i = B_i L^-T and z = L^-1 c,
//   A_i - Y_i Y_i^T at state i,  -Y_i Y_j^T between states,  a_i - Y_i z in the gradient.
// Without calibration columns; NormalEquations::addLandmark has the scalar form with them.
// Frames, Jacobians and robust weights: vision_factor.hpp. Shapes: see PoseGroup.
// Memory: 9 KiB on the stack. Cost: linear in the views.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>

#include "estimator/smoother/eliminated_point.hpp"
#include "estimator/smoother/view_lanes.hpp"

namespace swiftlet {

class LandmarkLanes {
 public:
  /// Four states; before eliminate() A, B, a of the header, after it A - Y Y^T, Y, a - Y z.
  struct PoseGroup {
    static constexpr std::size_t kDim = kPoseDim;
    lanes::V information[kDim * (kDim + 1) / 2];  ///< lower triangle by columns
    lanes::V point[kDim][3];
    lanes::V gradient[kDim];
    lanes::Mask valid;  ///< in front of a camera of this state
  };

  /// Linearizes. States keep the order of `landmark.sightings`.
  LandmarkLanes(const Landmark& landmark, RigPoses poses, const std::array<SE3, kMaxCameras>& T_body_cam);

  /// False when fewer than two states are valid or the point's information is singular.
  [[nodiscard]] bool eliminate();

  /// State k is lane k % kLanes of group k / kLanes.
  [[nodiscard]] std::span<const PoseGroup> groups() const { return {groups_, count_}; }
  [[nodiscard]] double cost() const { return sums_.cost(); }
  /// After eliminate().
  [[nodiscard]] const PointFactor& factor() const { return L_; }
  [[nodiscard]] const Eigen::Vector3d& z() const { return z_; }

 private:
  struct Camera {
    Eigen::Matrix3d R_body_cam;
    Eigen::Vector3d center;  // body
  };

  void addViews(std::size_t c, const Camera& camera, std::span<const Sighting> four, RigPoses poses,
                PoseGroup& group);
  void addRows(const Camera& camera, const lanes::ViewGroup& views, const lanes::Residuals& now,
               const lanes::Residuals& at, PoseGroup& group);

  static constexpr std::size_t kMaxGroups = (kMaxStates + lanes::kLanes - 1) / lanes::kLanes;

  const LandmarkPoint& point_;
  const PointBasis basis_;
  lanes::PointSums sums_;
  std::size_t count_ = 0;
  int valid_states_ = 0;
  PointFactor L_;
  Eigen::Vector3d z_;
  PoseGroup groups_[kMaxGroups];
};

}  // namespace swiftlet
