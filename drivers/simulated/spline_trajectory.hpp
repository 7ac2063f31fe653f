#pragma once
// A rigid motion whose pose and every derivative are exact: a uniform B-spline of degree 5.
//
// Position p(t) is a quintic B-spline in R^3, attitude R(t) a cumulative quintic B-spline on SO(3). Both are
// four times continuously differentiable, so velocity, acceleration, angular rate and angular acceleration
// are those of the motion itself, not differences of poses. Frames: T_world_body; velocities and
// accelerations in world axes, rates in body axes. Time: seconds since the trajectory's own zero; outside
// [startTime(), endTime()] the nearest end is used. Control k has its greatest influence at time start + (k -
// 2) spacing. Memory: 56 bytes per control; evaluation takes about 1 us without allocation.
// Source: de Boor's recurrence for uniform knots; Sommer, Usenko, Schubert, Demmel, Cremers, "Efficient
// Derivative Computation for Cumulative B-Splines on Lie Groups", CVPR 2020, eq. 22-31.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct MotionState {
  SE3 T_world_body;
  Eigen::Vector3d v_world_body = Eigen::Vector3d::Zero();  ///< m/s, world axes
  Eigen::Vector3d a_world_body = Eigen::Vector3d::Zero();  ///< m/s^2, world axes, without gravity
  Eigen::Vector3d omega_body = Eigen::Vector3d::Zero();    ///< rad/s, body axes
  Eigen::Vector3d alpha_body = Eigen::Vector3d::Zero();    ///< rad/s^2, body axes
};

/// Derivatives of a state by the controls that determine it. A control moves as R <- R Exp(phi), p <- p + d.
struct SplineJacobian {
  static constexpr std::size_t kOrder = 6;
  std::size_t first = 0;                         ///< the oldest of kOrder controls
  std::array<double, kOrder> position{};         ///< d p / d d, times the identity
  std::array<double, kOrder> acceleration{};     ///< d a / d d [1/s^2]
  std::array<Eigen::Matrix3d, kOrder> rotation;  ///< d turn / d phi, where R moves as R <- R Exp(turn)
  std::array<Eigen::Matrix3d, kOrder> rate;      ///< d omega_body / d phi [1/s]
};

class SplineTrajectory {
 public:
  static constexpr std::size_t kOrder = SplineJacobian::kOrder;  ///< controls per segment
  static constexpr std::size_t kCentreOffset = 2;                ///< controls before the first instant

  SplineTrajectory() = default;
  /// At least kOrder controls, `spacing` seconds apart; the first segment begins at `start`.
  SplineTrajectory(double start, double spacing, std::vector<SE3> controls);

  /// The spline whose value at start + k spacing is samples[k] (to 1e-9 m and rad unless neighbours
  /// turn by more than about a radian). At least two samples; the ends are continued by reflection.
  static SplineTrajectory interpolate(double start, double spacing, const std::vector<SE3>& samples);

  [[nodiscard]] double startTime() const { return start_; }
  [[nodiscard]] double endTime() const {
    return start_ + spacing_ * static_cast<double>(controls_.size() + 1 - kOrder);
  }
  [[nodiscard]] double spacing() const { return spacing_; }
  [[nodiscard]] const std::vector<SE3>& controls() const { return controls_; }
  [[nodiscard]] std::vector<SE3>& controls() { return controls_; }

  [[nodiscard]] SE3 pose(double seconds) const;
  [[nodiscard]] MotionState at(double seconds) const;
  /// The same, with the derivatives by the controls. About 2 us.
  [[nodiscard]] MotionState at(double seconds, SplineJacobian& jacobian) const;

 private:
  struct Segment {
    std::size_t first = 0;  ///< index of the oldest control
    double u = 0;           ///< position in the segment, 0 to 1
  };
  [[nodiscard]] Segment segmentOf(double seconds) const;

  double start_ = 0;
  double spacing_ = 1;
  std::vector<SE3> controls_;
};

}  // namespace swiftlet
