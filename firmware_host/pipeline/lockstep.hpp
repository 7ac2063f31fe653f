#pragma once
// The lockstep executor: one thread takes the place of all, message by message, as fast as it goes. The same
// log and settings give the same bytes; a feed that ends earlier gives the beginning of the same output.

#include "firmware_host/pipeline/log_feed.hpp"
#include "firmware_host/pipeline/run_control.hpp"
#include "firmware_host/pipeline/wiring.hpp"

namespace swiftlet {

/// Runs to the end of the feed and of all that follows from it. False when it was stopped.
bool runLockstep(LogFeed& feed, Wiring& wiring, const RunControl& control);

}  // namespace swiftlet
