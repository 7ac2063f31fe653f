#pragma once
// What the smoother's parts work on: states, landmarks, planes, calibration, prior, and where they stand in
// the system. One thread; the parts take it by reference and keep nothing of it.
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

/// What the first state of an epoch is known to be. Its position and yaw define the world.
struct StartState {
  Stamp stamp;  ///< on the IMU's clock
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
  ImuNoise noise;        ///< as told
  ImuExcess imu_excess;  ///< beyond it
  ImuBuffer imu;
  Window window;
  LandmarkTable landmarks;
  ExtraTable extras;
  CalibrationState calibration;
  GyroIntrinsicsState intrinsics;
  Prior prior;
  std::array<RigPose, kMaxStates> rig_poses;  ///< by slot, as last placed
  std::uint64_t oldest_recent_frame = 0;      ///< a landmark not seen since is out of sight
  int dimension = 0;

  /// Of states, landmarks, planes and prior; samples and calibration stay.
  void clear();
  void assignOffsets();
  /// First column of a prior's block (PriorBlock::slot).
  [[nodiscard]] int offsetOf(std::uint8_t slot) const;
  /// First estimates move with the window.
  void moveEstimates();
  /// Cameras at the states, with the calibration as it is.
  void placeCameras();
  [[nodiscard]] LandmarkViews viewsOf(std::span<const Sighting> sightings) const;
  /// The prior of the first state alone, and of the calibration.
  void startPrior(const StartState& start);

  void retract(const Eigen::Ref<const Eigen::VectorXd>& step);
  void backup();
  void restore();

  /// The IMU's increment from `previous` to `state`, at the biases of `previous`.
  void integrateLink(WindowState& state, const WindowState& previous) const;
};

}  // namespace swiftlet
