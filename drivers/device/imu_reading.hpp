#pragma once
// One reading of an inertial sensor as its decoder gives it: sensor axes, sensor clock, host arrival time.
// `drivers/timesync` computes the stamp of an ImuSample from it, the vehicle's settings the body axes.

#include <Eigen/Core>

#include <cstdint>
#include <optional>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct ImuReading {
  Stamp arrival;                         ///< CLOCK_MONOTONIC, of the first byte or frame of the message
  std::optional<Stamp> device;           ///< the sensor's own clock, unwrapped; empty if it sends none
  std::optional<std::uint64_t> counter;  ///< the sensor's own sample counter, unwrapped; empty: none
  Eigen::Vector3d gyro;                  ///< angular rate [rad/s]
  Eigen::Vector3d accel;                 ///< specific force [m/s^2]: +9.81 along the axis that points up
  Duration mean_age = {};  ///< if the values are means: time from the middle of their interval to `device`
  /// CLOCK_MONOTONIC stamp of the reading, if the driver maps the sensor's clock itself.
  std::optional<Stamp> host = {};
};

}  // namespace swiftlet
