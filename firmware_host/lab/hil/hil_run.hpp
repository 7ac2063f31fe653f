#pragma once
// Hardware-in-the-loop replay as a function: a recorded flight is played through the kernel's own devices, so
// that readers see it as hardware. Called by `swiftlet hil`.
//
// - IMU: the sensor's protocol on a pseudo-terminal under the port's name, or RawIMU on a CAN interface, with
//   its own clock that starts at an arbitrary value and runs fast.
// - Cameras: output nodes of the kernel's vivid driver, whose capture nodes show the images at whole periods
//   of CLOCK_MONOTONIC. The log's cameras must run at a steady rate, the one in the settings.
// - Trigger: a line of the kernel's gpio-sim.
// Image k of the log is seen at the k-th instant; samples and edges are sent when they are due relative to
// it.

#include <atomic>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/lab/hil/fault_timeline.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct HilRequest {
  std::string log;
  std::string out;  ///< folder for truth.tum, hil.json and faults.csv
  FaultTimeline faults;
  double seconds = 0;    ///< of the log, from its first image; 0: whole log
  double skew_ppm = 30;  ///< how much the sensor's clock is fast
  double patience = 30;  ///< s, longest wait for a reader of the IMU
  double lead = 1;       ///< s, least time from the reader's connection to the first image
  const std::atomic<bool>* stop = nullptr;
};

struct HilResult {
  nlohmann::ordered_json report;  ///< as written to hil.json
  bool complete = false;          ///< everything was played, and every image was seen at its due time
};

/// InputError for a log that cannot be played this way, and for devices that do not open.
HilResult runHil(const HilRequest& request, const Settings& settings);

}  // namespace swiftlet
