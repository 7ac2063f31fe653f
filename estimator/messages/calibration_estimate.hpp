#pragma once
// The calibration in use: the given one, or its estimate if that is enabled.

#include <array>

#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"
#include "estimator/messages/gyro_intrinsics.hpp"

namespace swiftlet {

/// Prior standard deviations of the given calibration if it is estimated in flight. A driver that stamps
/// images at their arrival has an error of 15 ms, 1.5 sigma.
inline constexpr double kTimeOffsetPriorSigma = 10e-3;  ///< s
/// Readouts from drivers and data sheets are exact; those of another mode or from other tools have errors of
/// a few per cent of 20 to 60 ms.
inline constexpr double kReadoutPriorSigma = 2e-3;            ///< s
inline constexpr double kExtrinsicRotationPriorSigma = 0.01;  ///< rad
/// Calibrations give positions relative to the IMU with errors of a few millimetres.
inline constexpr double kExtrinsicPositionPriorSigma = 2e-3;  ///< m
/// Calibrations give the length of the baseline, which is the scale of two cameras, to one part in a
/// thousand.
inline constexpr double kBaselinePriorSigma = 1e-3;

/// Sigmas: largest over the axes, from the last solve; 0 if the value is not estimated.
struct CalibrationEstimate {
  Duration camera_to_imu_shift;  ///< t_imu = t_image + shift
  Duration readout;              ///< Rig::readout
  std::array<SE3, kMaxCameras> T_body_cam;
  GyroIntrinsics gyro;                               ///< zero if not estimated
  double shift_sigma = 0;                            ///< s
  double readout_sigma = 0;                          ///< s
  std::array<double, kMaxCameras> rotation_sigma{};  ///< rad
  std::array<double, kMaxCameras> position_sigma{};  ///< m
  double stereo_rotation_sigma = 0;                  ///< rad, of camera 1 relative to camera 0
};

}  // namespace swiftlet
