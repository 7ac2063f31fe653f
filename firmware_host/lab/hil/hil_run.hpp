#pragma once
// Hardware-in-the-loop replay as a function: a recorded flight played out through the kernel's own devices,
// so that whoever reads them takes it for hardware. What `swiftlet hil` calls.
//
// - IMU: the sensor's protocol on a pseudo-terminal under the port's name, or RawIMU on a CAN interface, with
// a
//   clock of its own that starts anywhere and runs fast.
// - Cameras: output nodes of the kernel's vivid driver, whose capture nodes show the images at whole periods
// of
//   CLOCK_MONOTONIC. The log's cameras must run at a steady rate: the settings' one.
// - Trigger: a line of the kernel's gpio-sim.
// Image k of the log is seen at the k-th instant; samples and edges go out when they are due by that.

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
  double seconds = 0;    ///< of the log, from its first image; 0: all
  double skew_ppm = 30;  ///< by which the sensor's clock is fast
  double patience = 30;  ///< s to wait for a reader of the IMU
  double lead = 1;       ///< s from the reader's coming to the first image at the least
  const std::atomic<bool>* stop = nullptr;
};

struct HilResult {
  nlohmann::ordered_json report;  ///< as written to hil.json
  bool complete = false;          ///< all was played, and every image was seen when it was due
};

/// InputError for a log that cannot be played so, and for devices that do not open.
HilResult runHil(const HilRequest& request, const Settings& settings);

}  // namespace swiftlet
