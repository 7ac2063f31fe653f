#pragma once
// Scale and misalignment of a gyro: reading = (I + matrix) rate + bias, in body axes.
//
// 0.01 on the diagonal is a scale error of 1 %; 0.01 elsewhere is an axis tilted by 0.01 rad. Those of the
// accelerometer are not modelled: in simulated flights their effect is negligible compared with the gyro's,
// and with one camera the accelerometer's scale cannot be separated from that of the flight. g-sensitivity is
// not modelled.

#include <Eigen/Core>

namespace swiftlet {

/// Prior standard deviation of each entry: 0.5 %, 0.3 degrees, as in OpenVINS's State.cpp.
inline constexpr double kGyroMatrixPriorSigma = 5e-3;

struct GyroIntrinsics {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();

  /// rad/s, to first order; still includes the bias.
  [[nodiscard]] Eigen::Vector3d rate(const Eigen::Vector3d& reading) const {
    return reading - matrix * reading;
  }
};

}  // namespace swiftlet
