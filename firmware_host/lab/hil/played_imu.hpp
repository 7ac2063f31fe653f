#pragma once
// The IMU of a hardware-in-the-loop replay: the log's samples on its wire when they are due, in a clock of
// the sensor's own, and what the faults make of them.

#include <memory>
#include <optional>

#include "drivers/calibration/calibration.hpp"
#include "drivers/calibration/imu_correction.hpp"
#include "firmware_host/lab/hil/fault_timeline.hpp"
#include "firmware_host/lab/hil/imu_wire.hpp"
#include "firmware_host/lab/hil/log_reader.hpp"
#include "firmware_host/lab/hil/played_camera.hpp"
#include "firmware_host/realtime/latency_histogram.hpp"

namespace swiftlet {

class PlayedImu {
 public:
  struct Counters {
    std::uint64_t sent = 0;
    std::uint64_t withheld = 0;  ///< by faults
  };

  /// `correction`: samples of logs are corrected and in body axes, a sensor sends its own readings.
  PlayedImu(std::unique_ptr<ImuWire> wire, LogReader& reader, const FaultTimeline& faults,
            const ImuCorrection& correction, double skew_ppm);

  DeviceFault open() { return wire_->open(); }
  [[nodiscard]] bool isRead() { return wire_->isRead(); }
  /// The log's first sample; empty: none.
  [[nodiscard]] const std::optional<ImuSample>& next() const { return next_; }
  void begin(const FrameGrid& grid, Stamp last_log);

  DeviceFault step(Stamp now);
  /// When the next sample is due; empty at the end.
  [[nodiscard]] std::optional<Stamp> due() const;
  [[nodiscard]] const Counters& counters() const { return counters_; }
  /// By which samples went out late.
  [[nodiscard]] const LatencyHistogram& lateness() const { return lateness_; }

 private:
  DeviceFault send(const ImuSample& sample, Duration time);

  std::unique_ptr<ImuWire> wire_;
  LogReader& reader_;
  const FaultTimeline& faults_;
  ImuCorrection to_readings_;
  double rate_;  ///< of the sensor's clock
  FrameGrid grid_;
  Stamp last_log_;
  std::optional<ImuSample> next_;
  std::uint64_t number_ = 0;
  bool unplugged_ = false;
  Counters counters_;
  LatencyHistogram lateness_;
};

}  // namespace swiftlet
