#pragma once
// Repeats a threaded run from its recording, on one thread: each stage takes what it took then (samples,
// images, the window or fix that was newest for it, the effort), so that every output has the same bytes
// however the threads had run.
//
// Order: a tracked frame needs the window that it predicted from, so `smooth` is repeated up to that window
// and no further; propagation is repeated beside it from the fixes.

#include <string>

#include "drivers/recorded/recording_source.hpp"
#include "firmware_host/pipeline/lockstep.hpp"
#include "firmware_host/pipeline/run_log.hpp"
#include "firmware_host/settings/settings.hpp"
#include "mapping/place/vocabulary.hpp"

namespace swiftlet {

struct ReproduceReport {
  bool finished = true;  ///< false: stopped
  std::uint64_t frames = 0;
  std::string stopped_early;  ///< why the recording could not be followed to its end; empty: it was
};

/// `settings`: those that were recorded. Wants what `wanted` says of the run.
/// `vocabulary`: of loop closure; null: the shipped one.
ReproduceReport reproduce(RecordingSource& recording, const Settings& settings, RunLog& log, bool imu_states,
                          const RunControl& control, const Vocabulary* vocabulary = nullptr);

}  // namespace swiftlet
