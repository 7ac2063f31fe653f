#pragma once
// Feeds every stage inputs that fill its capacities and measures the longest step.
//
//   propagate: a fix so old that every kept sample (Propagator's ring) is applied again, then a sample
//   track:     a rendered flight with the most features, with blackouts after which all are detected anew
//   smooth:    simulated tracks with the most features per frame, all seen by both cameras, short-lived so
//              that the landmarks fill up, with 1 kHz of IMU
// `track` and `smooth` run in the graph, in lockstep. Efforts are those of the settings.

#include <functional>

#include "firmware_host/realtime/stage_timer.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct WorstCase {
  StageTable times;           ///< kImu, kTrack, kSmooth, kTrim
  std::size_t features = 0;   ///< largest number in a rendered frame
  std::size_t tracks = 0;     ///< largest number in a simulated frame
  std::size_t landmarks = 0;  ///< largest number in the window
};

/// `progress` (may be empty) is called with what is being done.
WorstCase measureWorstCase(const Settings& settings, const std::function<void(const char*)>& progress);

}  // namespace swiftlet
