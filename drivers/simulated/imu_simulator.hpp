#pragma once
// Simulates the readings of an IMU on a trajectory: exact rate and specific force plus the errors of the
// noise model.
//
// reading = M truth + bias + white noise + vibration, then clipped at the saturation. M: scale errors and
// misalignment, one matrix for each sensor.
// White noise of density n has standard deviation n sqrt(rate) a sample; biases are random walks
// with steps of density sqrt(1 / rate) (Woodman, UCAM-CL-TR-696, 2007; Kalibr's IMU noise model).
// Specific force: R_body_world (a_world + (0, 0, gravity)). SI units, body axes.
// Everything follows from the seed. Each error source has its own random stream, so disabling one does not
// change the others.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "drivers/simulated/spline_trajectory.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

/// Motor vibration as a sum of sines with random phases, constant amplitude, in a band.
struct Vibration {
  double accel_amplitude = 0;  ///< m/s^2: a sine of this amplitude on each axis has the same power
  double gyro_amplitude = 0;   ///< rad/s: the same for the gyro
  double low_hz = 80;
  double high_hz = 150;
};

/// Seconds since the trajectory's zero.
struct TimeSpan {
  double begin = 0;
  double end = 0;
  [[nodiscard]] bool contains(double t) const { return t >= begin && t < end; }
};

struct ImuSimulationSettings {
  ImuNoise noise;           ///< densities, rate, gravity, saturation
  bool noise_free = false;  ///< exact readings: no noise, no bias, no vibration, ideal matrices
  /// Initial biases. Drawn with these standard deviations per axis when `draw_bias`.
  bool draw_bias = true;
  double gyro_bias_sigma = 0.02;   ///< rad/s
  double accel_bias_sigma = 0.08;  ///< m/s^2
  Eigen::Vector3d bias_gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d bias_accel = Eigen::Vector3d::Zero();
  Eigen::Matrix3d gyro_matrix = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d accel_matrix = Eigen::Matrix3d::Identity();
  Vibration vibration;
  std::vector<TimeSpan> gaps;  ///< spans without samples
  /// Spans in which the sensor clips at the limits below.
  std::vector<TimeSpan> saturations;
  double low_gyro_limit = 1.0;    ///< rad/s
  double low_accel_limit = 12.0;  ///< m/s^2
  std::uint64_t seed = 1;
};

struct SimulatedImu {
  std::vector<ImuSample> samples;
  /// True biases at every step k / rate, including those in gaps.
  std::vector<Eigen::Vector3d> bias_gyro;
  std::vector<Eigen::Vector3d> bias_accel;
};

/// Reading k has the stamp `zero` + round(k 1e9 / rate) ns, at trajectory time k / rate, for times from 0 to
/// `duration` inclusive.
SimulatedImu simulateImu(const SplineTrajectory& trajectory, const ImuSimulationSettings& settings,
                         Stamp zero, double duration);

}  // namespace swiftlet
