#pragma once
// Scale and misalignment of a gyro: reading = (I + matrix) rate + bias, in body axes.
//
// 0.01 on the diagonal is a scale error of 1 %, off it an axis that leans by 0.01 rad. The accelerometer has
// none here: over simulated flights its scale and misalignment cost nothing beside the gyro's, and with one
// camera its scale would be that of the flight. g-sensitivity is not modelled.

#include <Eigen/Core>

namespace swiftlet {

/// Standard deviation of each entry beforehand: 0.5 %, 0.3 degrees, as in OpenVINS's State.cpp.
inline constexpr double kGyroMatrixPriorSigma = 5e-3;

struct GyroIntrinsics {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();

  /// rad/s, with the bias, to first order.
  [[nodiscard]] Eigen::Vector3d rate(const Eigen::Vector3d& reading) const {
    return reading - matrix * reading;
  }
};

}  // namespace swiftlet
