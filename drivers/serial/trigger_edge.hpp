#pragma once
// An edge of a trigger or synchronisation line as an inertial sensor saw it: in the clock of its samples,
// which is what ties frames to samples without the host's clock in between.

#include <cstdint>
#include <optional>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct TriggerEdge {
  Stamp arrival;               ///< CLOCK_MONOTONIC, of the first byte of the message that reported it
  Stamp device;                ///< of the edge, in the sensor's clock: comparable with ImuReading::device
  std::uint64_t counter = 0;   ///< of edges, unwrapped: a jump reveals edges that were not reported
  std::uint8_t line = 0;       ///< input number, if there are several
  std::optional<bool> rising;  ///< empty: not reported; the sensor's settings choose the polarity

  bool operator==(const TriggerEdge&) const = default;
};

}  // namespace swiftlet
