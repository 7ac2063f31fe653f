#pragma once
// The state propagated to an IMU sample, in the form sent to another core at every sample: 0.5 kB instead of
// NavState's 2 kB, which is mostly covariance that is not needed at this rate. Values are NavState's; the
// covariance is single precision and omits the accelerometer bias. Cost: 0.05 us to make, the same to take.

#include <array>
#include <cstddef>

#include "estimator/messages/nav_state.hpp"

namespace swiftlet {

class StateNews {
 public:
  /// Leading rows of the state's error that are sent: phi, p, v, bg.
  static constexpr int kTold = 12;

  StateNews() = default;
  /// `omega_body`: angular rate of the sample, without bias [rad/s].
  StateNews(const NavState& state, const Eigen::Vector3d& omega_body);

  [[nodiscard]] const Eigen::Vector3d& omegaBody() const { return omega_body_; }
  /// The NavState, except that the accelerometer bias's rows and columns of the covariance are 0.
  [[nodiscard]] NavState state() const;

 private:
  static constexpr std::size_t kTriangle = std::size_t{kTold} * (kTold + 1) / 2;

  Stamp stamp_;
  std::uint32_t epoch_ = 0;
  Health health_ = Health::kInitializing;
  SE3 T_world_body_;
  Eigen::Vector3d v_world_body_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_gyro_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_accel_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d omega_body_ = Eigen::Vector3d::Zero();
  std::array<float, kTriangle> covariance_ = {};  ///< lower triangle, column by column from the diagonal down
};

}  // namespace swiftlet
