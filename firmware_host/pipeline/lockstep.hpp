#pragma once
// The lockstep executor: one thread drives the wiring from a log as fast as it goes. The same log and
// settings give the same bytes; a plan that ends earlier gives the beginning of the same output.

#include <atomic>
#include <functional>
#include <optional>

#include "drivers/recorded/log_source.hpp"
#include "drivers/recorded/track_file.hpp"
#include "firmware_host/pipeline/wiring.hpp"

namespace swiftlet {

struct ReplayPlan {
  double from = 0;                          ///< s after the log's first image
  std::optional<double> until;              ///< s after the log's first image; images up to and including it
  std::optional<Stamp> last_stamp;          ///< the same as a stamp: nothing later is fed
  TrackReader* tracks = nullptr;            ///< in place of images, which the source must not deliver then
  const std::atomic<bool>* stop = nullptr;  ///< set: end cleanly after the current message
  /// Called with the number of images, or frames of tracks, taken so far.
  std::function<void(std::uint64_t)> progress;
};

/// Runs to the end of the log (or the plan) and finishes the wiring. False when it was stopped.
bool runLockstep(LogSource& source, Wiring& wiring, const ReplayPlan& plan);

}  // namespace swiftlet
