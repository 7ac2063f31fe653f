#pragma once
// The host's clock CLOCK_MONOTONIC. Cost: about 30 ns.

#include <ctime>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

[[nodiscard]] inline Stamp monotonicNow() {
  timespec now = {};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return {static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec};
}

}  // namespace swiftlet
