#pragma once
// An edge of the cameras' trigger, passed to a camera's thread.

#include <cstdint>

#include "estimator/core/spsc_ring.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct EdgeMessage {
  Stamp stamp;                 ///< CLOCK_MONOTONIC
  std::uint64_t sequence = 0;  ///< number of the edge; a jump means that edges were not read
};

/// A camera's thread reads the ring with every frame: room for half a second of the fastest cameras.
using EdgeRing = SpscRing<EdgeMessage, 256>;

}  // namespace swiftlet
