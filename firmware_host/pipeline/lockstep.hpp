#pragma once
// The lockstep executor: one thread takes the place of all, message by message, as fast as it goes. The same
// log and settings give the same bytes; a feed that ends earlier gives the beginning of the same output.

#include <atomic>
#include <cstdint>
#include <functional>

#include "firmware_host/pipeline/log_feed.hpp"
#include "firmware_host/pipeline/wiring.hpp"

namespace swiftlet {

/// What whoever waits for a run may want of it.
struct RunControl {
  const std::atomic<bool>* stop = nullptr;  ///< set: end cleanly after the current message
  /// Called with the number of images, or frames of tracks, taken so far.
  std::function<void(std::uint64_t)> progress;

  [[nodiscard]] bool stopped() const { return stop != nullptr && stop->load(std::memory_order_relaxed); }
};

/// Runs to the end of the feed and of all that follows from it. False when it was stopped.
bool runLockstep(LogFeed& feed, Wiring& wiring, const RunControl& control);

}  // namespace swiftlet
