#pragma once
// Draws random stereo rigs with an IMU, for calibration.
//
// Drawn from the seed only: the image size; the lens angle over the width of the image (radial-tangential 60
// to 100 degrees, Kannala-Brandt 100 to 190) with distortion that is monotonic over the whole image; a
// baseline of 3 to 30 cm and a small misalignment of camera 1; the IMU's pose (any orientation, lever arm up
// to 10 cm), its noise (EuRoC's ADIS16448 or TUM-VI's BMI160), scale and misalignment of 0.5 %; a time shift
// within 10 ms; a global shutter or a readout of 5 to 25 ms.

#include <Eigen/Core>
#include <cstdint>

#include "drivers/simulated/rig_presets.hpp"
#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"

namespace swiftlet {

struct CalibrationRig {
  Rig rig;  ///< the truth, with the shift t_imu = t_image + shift and the readout
  ImuNoise noise;
  /// reading = matrix true + bias. The accelerometer's matrix is lower triangular, since its axes define the
  /// body.
  Eigen::Matrix3d gyro_matrix = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d accel_matrix = Eigen::Matrix3d::Identity();
};

/// The same seed gives the same bytes.
CalibrationRig drawCalibrationRig(std::uint64_t seed, CameraKind lens);

/// A rig of the given kind: drawn by `seed`, or a preset with the given IMU.
CalibrationRig makeCalibrationRig(RigKind kind, std::uint64_t seed);

}  // namespace swiftlet
