#pragma once
// An edge of a trigger or synchronisation line seen by an inertial sensor, stamped in the clock of its
// samples. So frames and samples are related without the host's clock.

#include <cstdint>
#include <optional>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct TriggerEdge {
  Stamp arrival;               ///< CLOCK_MONOTONIC, of the first byte of the message that reported it
  Stamp device;                ///< of the edge, in the sensor's clock: comparable with ImuReading::device
  std::uint64_t counter = 0;   ///< count of edges, unwrapped: a jump means that edges were not reported
  std::uint8_t line = 0;       ///< input number, if there are several
  std::optional<bool> rising;  ///< empty: not reported; the polarity is set in the sensor

  bool operator==(const TriggerEdge&) const = default;
};

}  // namespace swiftlet
