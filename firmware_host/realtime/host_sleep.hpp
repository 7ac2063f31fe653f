#pragma once
// Sleeping on the host's monotonic clock [s], as wallSeconds() counts it.

#include "estimator/core/stamp.hpp"

namespace swiftlet {

void sleepUntil(double host_seconds);
void sleepFor(Duration duration);

}  // namespace swiftlet
