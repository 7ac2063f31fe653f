#pragma once
// A recording of the vehicle's devices as a function. Called by `swiftlet record`.

#include <atomic>
#include <string>
#include <vector>

#include "firmware_host/outputs/recorder/record_sink.hpp"
#include "firmware_host/runs/record_watcher.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct RecordRequest {
  std::string out;     ///< folder or file
  bool mcap = false;   ///< an MCAP file instead of an EuRoC folder
  double seconds = 0;  ///< stop after this long; 0: only on request
  const std::atomic<bool>* stop = nullptr;
  RecordWatcher* watcher = nullptr;  ///< null: none
};

struct RecordResult {
  RecordSink::Counters written;
  std::size_t cameras = 0;
  std::vector<std::string> missing;  ///< devices that did not open, as text; then nothing was recorded
};

/// InputError for bad settings or calibration, and if the recording cannot be written.
RecordResult runRecord(const RecordRequest& request, const Settings& settings);

}  // namespace swiftlet
