#pragma once
// What the counters of a stream say about its device, in words.

#include "drivers/device/device_fault.hpp"
#include "drivers/device/stream_counters.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// Long enough for the slowest sensor and for an autopilot that was just asked for its rate.
constexpr Duration kStreamJudgementTime = Duration::fromMilliseconds(2'000);

/// Compares the counters of kStreamJudgementTime ago with those of now: no fault when samples came; silent
/// when nothing came; garbage (wrong baud rate or protocol) when bytes came and no frame; unsupported when
/// frames came without samples: the output is not switched on.
DeviceFault streamFault(const StreamCounters& before, const StreamCounters& now);

}  // namespace swiftlet
