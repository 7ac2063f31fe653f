#pragma once
// Request for a run on a log: log, calibration and section. Base of the commands' requests.

#include <atomic>
#include <optional>
#include <string>

#include "drivers/recorded/log_source.hpp"
#include "estimator/odometry/odometry_inputs.hpp"
#include "firmware_host/inputs/log/log_feed.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

struct LogRequest {
  std::string log;
  std::string calibration;          ///< instead of the log's own; empty: the log's
  std::string imu_calibration;      ///< Kalibr's IMU file if it is not beside the camchain
  bool mono = false;                ///< camera 0 alone
  double from = 0;                  ///< s after the first image
  std::optional<double> until;      ///< s after the first image
  std::optional<Stamp> last_stamp;  ///< like `until`, as a stamp
  const std::atomic<bool>* stop = nullptr;
  bool show_progress = false;

  [[nodiscard]] LogOptions options(const Settings& settings) const {
    LogOptions options;
    options.calibration = calibration;
    options.imu_calibration = imu_calibration;
    options.calibration_options.accept_unusual_rig = settings.calibration.accept_unusual_rig;
    options.mono = mono;
    options.shift_margin = shiftMargin(settings.odometry);
    return options;
  }
  [[nodiscard]] LogSection section() const { return {from, until, last_stamp}; }
  [[nodiscard]] bool stopped() const { return stop != nullptr && stop->load(std::memory_order_relaxed); }
};

}  // namespace swiftlet
