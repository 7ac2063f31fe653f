#pragma once
// An edge of the cameras' trigger on its way to the thread of a camera.

#include <cstdint>

#include "estimator/core/spsc_ring.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct EdgeMessage {
  Stamp stamp;                 ///< CLOCK_MONOTONIC
  std::uint64_t sequence = 0;  ///< of edges; a jump shows edges that were not read
};

/// A camera's thread looks with every frame: room for half a second of the fastest cameras.
using EdgeRing = SpscRing<EdgeMessage, 256>;

}  // namespace swiftlet
