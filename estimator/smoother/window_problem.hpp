#pragma once
// The data of the smoother: states, landmarks, planes, calibration, prior, and their columns in the system.
// For one thread; the parts of the smoother take it by reference and keep no reference.
//
// Columns of a system: calibration, gyro intrinsics, explicit landmarks and planes, states in order of time.

#include <array>
#include <cstdint>
#include <span>

#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/smoother/calibration_state.hpp"
#include "estimator/smoother/extra_table.hpp"
#include "estimator/smoother/gyro_intrinsics_state.hpp"
#include "estimator/smoother/imu_buffer.hpp"
#include "estimator/smoother/imu_excess.hpp"
#include "estimator/smoother/landmark_table.hpp"
#include "estimator/smoother/prior.hpp"
#include "estimator/smoother/vision_factor.hpp"
#include "estimator/smoother/window.hpp"

namespace swiftlet {

/// Prior of the first state of an epoch. Its position and yaw define the world.
struct StartState {
  BodyState state;
  double tilt_sigma = 0.05;        ///< rad
  double velocity_sigma = 1.0;     ///< m/s
  double gyro_bias_sigma = 0.1;    ///< rad/s
  double accel_bias_sigma = 0.15;  ///< m/s^2
};

struct WindowProblem {
  WindowProblem(const Rig& given_rig, const ImuNoise& imu_noise, bool estimate_time_offset,
                bool estimate_extrinsics, bool estimate_gyro);

  Rig rig;
  ImuNoise noise;        ///< as configured
  ImuExcess imu_excess;  ///< factors on it, estimated in flight
  ImuBuffer imu;
  Window window;
  LandmarkTable landmarks;
  ExtraTable extras;
  CalibrationState calibration;
  GyroIntrinsicsState intrinsics;
  Prior prior;
  std::array<RigPose, kMaxStates> rig_poses;  ///< by slot, from the last placement
  std::uint64_t oldest_recent_frame = 0;      ///< landmarks last seen before this frame are out of view
  int dimension = 0;

  /// Clears states, landmarks, planes and prior; keeps samples and calibration.
  void clear();
  void assignOffsets();
  /// First column in the system of a block of the prior (PriorBlock::slot).
  [[nodiscard]] int offsetOf(std::uint8_t slot) const;
  /// Places cameras at the states, with the current calibration.
  void placeCameras();
  [[nodiscard]] LandmarkViews viewsOf(std::span<const Sighting> sightings) const;
  /// Sets the prior to that of the first state and the calibration.
  void startPrior(const StartState& start);

  void retract(const Eigen::Ref<const Eigen::VectorXd>& step);
  void backup();
  void restore();

  /// The IMU's increment from `previous` to `state`, at the biases of `previous`.
  void integrateLink(WindowState& state, const WindowState& previous) const;
};

}  // namespace swiftlet
