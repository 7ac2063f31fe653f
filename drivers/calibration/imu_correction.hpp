#pragma once
// Converts readings of an IMU to rates and forces in body axes, and back.
//
// Model (Kalibr's scale-misalignment; matrices map true to measured, in the sensor's own axes):
//   accel = accel_matrix f + bias,   gyro = gyro_matrix omega + gyro_by_force f + bias.
// Biases are not removed: the correction changes them to other constants, which the estimator finds as well.

#include <Eigen/Core>
#include <Eigen/LU>

#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

struct ImuCorrection {
  Eigen::Matrix3d gyro = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d gyro_by_accel = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d accel = Eigen::Matrix3d::Identity();

  [[nodiscard]] bool isIdentity() const {
    return gyro.isIdentity(0) && gyro_by_accel.isZero(0) && accel.isIdentity(0);
  }
  [[nodiscard]] Eigen::Vector3d gyroOf(const Eigen::Vector3d& gyro_reading,
                                       const Eigen::Vector3d& accel_reading) const {
    if (gyro_by_accel.isZero(0)) return gyro * gyro_reading;
    return gyro * gyro_reading + gyro_by_accel * accel_reading;
  }
  [[nodiscard]] Eigen::Vector3d accelOf(const Eigen::Vector3d& accel_reading) const {
    return accel * accel_reading;
  }
  void apply(ImuSample& sample) const {
    sample.gyro = gyroOf(sample.gyro, sample.accel);
    sample.accel = accelOf(sample.accel);
  }
  /// This correction followed by the rotation R of both sensors.
  [[nodiscard]] ImuCorrection turned(const Eigen::Matrix3d& R) const {
    return {R * gyro, R * gyro_by_accel, R * accel};
  }
  /// The inverse: from corrected values to readings.
  [[nodiscard]] ImuCorrection inverse() const {
    ImuCorrection back;
    back.gyro = gyro.inverse();
    back.accel = accel.inverse();
    back.gyro_by_accel = -back.gyro * gyro_by_accel * back.accel;
    return back;
  }
};

}  // namespace swiftlet
