#pragma once
// The recorded schedule: repeats a threaded run from its recording on one thread. Before its turn each node
// receives what it used in the recorded run (samples, images, the newest window or fix, the effort), so every
// output has the same bytes regardless of how the threads ran.
//
// A node's turn waits until its inputs exist: windows, fixes and plane reports are kept by number until the
// step that used them. A node skips what it missed in the recorded run.

#include <cstdint>
#include <string>

#include "drivers/recorded/recording_source.hpp"
#include "firmware_host/graph/graph.hpp"
#include "firmware_host/interfaces/run_control.hpp"

namespace swiftlet {

/// The effort that the recording gives for a stage.
class RecordedEffort : public EffortSource {
 public:
  void tell(const Effort& effort) { effort_ = effort; }
  [[nodiscard]] Effort give() const override { return effort_; }
  void took(const StepTiming& /*timing*/) override {}
  [[nodiscard]] int level() const override { return 0; }

 private:
  Effort effort_;
};

struct RecordedEfforts {
  RecordedEffort track, smooth;
};

struct RepeatReport {
  bool finished = true;  ///< false: stopped on request
  std::uint64_t frames = 0;
  std::string stopped_early;  ///< why the recording could not be followed to its end; empty: it could
};

/// The graph is built from the recording's rig, noise and settings, with `efforts` in its options.
RepeatReport runRecorded(RecordingSource& recording, Graph& graph, RecordedEfforts& efforts,
                         const RunControl& control);

}  // namespace swiftlet
