#pragma once
// The IMU of a hardware-in-the-loop replay: sends the log's samples when they are due, stamped by a simulated
// sensor clock, with the effect of faults.

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
    std::uint64_t withheld = 0;  ///< not sent because of faults
  };

  /// `correction`: a log's samples are corrected and in body axes; the sensor sends its own readings.
  PlayedImu(std::unique_ptr<ImuWire> wire, LogReader& reader, const FaultTimeline& faults,
            const ImuCorrection& correction, double skew_ppm);

  DeviceFault open() { return wire_->open(); }
  [[nodiscard]] bool isRead() { return wire_->isRead(); }
  /// The log's first sample; empty: none.
  [[nodiscard]] const std::optional<ImuSample>& next() const { return next_; }
  void begin(const FrameGrid& grid, Stamp last_log);

  DeviceFault step(Stamp now);
  /// Due time of the next sample; empty at the end.
  [[nodiscard]] std::optional<Stamp> due() const;
  [[nodiscard]] const Counters& counters() const { return counters_; }
  /// Delay with which samples were sent.
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
