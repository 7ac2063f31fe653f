#pragma once
// Feeds every stage inputs that fill its capacities and measures the longest step.
//
//   propagate: a fix so old that every sample that is kept (Propagator's ring) is applied again, then a
//   sample track:     a rendered flight at the most features, with blackouts after which all of them are
//   found anew smooth:    simulated tracks at the most features a frame, all seen by both cameras,
//   short-lived so that the
//              landmarks fill up, with 1 kHz of IMU
// `track` and `smooth` run in the graph, in lockstep.
// Efforts as the settings give them.

#include <functional>

#include "firmware_host/realtime/stage_timer.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct WorstCase {
  StageTable times;           ///< kImu, kTrack, kSmooth, kTrim
  std::size_t features = 0;   ///< most in a frame, of those rendered
  std::size_t tracks = 0;     ///< most in a frame, of those simulated
  std::size_t landmarks = 0;  ///< most in the window
};

/// `progress` (may be empty) gets what is being done.
WorstCase measureWorstCase(const Settings& settings, const std::function<void(const char*)>& progress);

}  // namespace swiftlet
