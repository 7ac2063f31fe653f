#pragma once
// One IMU sample in body axes.

#include <Eigen/Core>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct ImuSample {
  Stamp stamp;            ///< centre of the sensing interval
  Eigen::Vector3d gyro;   ///< angular rate [rad/s], bias included
  Eigen::Vector3d accel;  ///< specific force R_B_W (a_W - g_W) [m/s^2], bias included
};

}  // namespace swiftlet
