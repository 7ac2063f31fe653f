#pragma once
// What one frame of a sensor held, in SI units and the sensor's axes: what protocols hand to ImuDecoder.

#include <Eigen/Core>

#include <cstdint>
#include <optional>

#include "drivers/serial/trigger_edge.hpp"
#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct InertialFrame {
  bool known = true;                     ///< false: a kind that is not read
  bool in_range = true;                  ///< false: a clock or a time that cannot be
  std::optional<Eigen::Vector3d> gyro;   ///< [rad/s]
  std::optional<Eigen::Vector3d> accel;  ///< [m/s^2]
  std::optional<Stamp> device;           ///< the sensor's clock, unwrapped
  std::optional<std::uint64_t> counter;  ///< unwrapped
  Duration mean_age;                     ///< as ImuReading has it
  FixedVector<TriggerEdge, 3> edges;     ///< arrival still to be filled in
};

}  // namespace swiftlet
