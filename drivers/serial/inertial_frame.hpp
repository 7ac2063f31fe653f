#pragma once
// Content of one sensor frame in SI units and the sensor's axes; protocols pass it to ImuDecoder.

#include <Eigen/Core>

#include <cstdint>
#include <optional>

#include "drivers/serial/trigger_edge.hpp"
#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct InertialFrame {
  bool known = true;                     ///< false: a kind that is not decoded
  bool in_range = true;                  ///< false: an impossible clock or time
  std::optional<Eigen::Vector3d> gyro;   ///< [rad/s]
  std::optional<Eigen::Vector3d> accel;  ///< [m/s^2]
  std::optional<Stamp> device;           ///< the sensor's clock, unwrapped
  std::optional<std::uint64_t> counter;  ///< unwrapped
  Duration mean_age;                     ///< as in ImuReading
  FixedVector<TriggerEdge, 3> edges;     ///< their arrival is filled in later
};

}  // namespace swiftlet
