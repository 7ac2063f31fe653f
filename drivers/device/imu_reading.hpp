#pragma once
// One reading as an inertial sensor's decoder gives it: its own axes, its own clock, the host's time of
// arrival. `drivers/timesync` makes an ImuSample's stamp of it, the vehicle's settings its axes.

#include <Eigen/Core>

#include <cstdint>
#include <optional>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct ImuReading {
  Stamp arrival;                         ///< CLOCK_MONOTONIC, of the message's first byte or frame
  std::optional<Stamp> device;           ///< the sensor's own clock, unwrapped; empty: it sends none
  std::optional<std::uint64_t> counter;  ///< the sensor's own count, unwrapped; empty: it sends none
  Eigen::Vector3d gyro;                  ///< angular rate [rad/s]
  Eigen::Vector3d accel;                 ///< specific force [m/s^2]: +9.81 along the axis that points up
  Duration mean_age = {};                ///< by which the values' middle lies before `device`: they are means
  /// Of `device`'s place, CLOCK_MONOTONIC, where the driver maps its clock itself.
  std::optional<Stamp> host = {};
};

}  // namespace swiftlet
