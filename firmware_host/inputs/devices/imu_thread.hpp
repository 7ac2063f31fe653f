#pragma once
// The thread of the IMU: passes samples from its link to the sink, stamped on CLOCK_MONOTONIC and rotated to
// body axes. The device may be unplugged and return, fall silent or restart its clock.
//
// Stamps: the sensor's own clock if it sends one, mapped by the protocol's clock exchange when that is
// certain, otherwise by the lower envelope of the delays (drivers/timesync/clock_map.hpp); stamps mapped by a
// driver are used as they are; without a clock, arrival times. Threads: open() before the flight, run() on
// its own thread, journal and status from any.

#include <memory>
#include <span>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "drivers/calibration/imu_correction.hpp"
#include "drivers/timesync/clock_map.hpp"
#include "estimator/core/newest_shared.hpp"
#include "firmware_host/inputs/devices/edge_message.hpp"
#include "firmware_host/inputs/devices/exposure_loop.hpp"
#include "firmware_host/inputs/devices/imu_link.hpp"
#include "firmware_host/inputs/devices/rate_watch.hpp"
#include "firmware_host/interfaces/device_journal.hpp"
#include "firmware_host/interfaces/sensor_input.hpp"

namespace swiftlet {

/// Counters of the IMU so far.
struct ImuStatus {
  std::uint64_t samples = 0;
  std::uint64_t refused = 0;  ///< without a stamp, or with one that does not rise
  std::uint64_t by_exchange = 0;
  std::uint64_t by_arrival = 0;
  std::uint64_t by_driver = 0;  ///< stamped with the host's time that the driver provides
  TimesyncStatus clock;
  std::uint64_t edges = 0;  ///< trigger edges passed to the cameras
  Stamp edge;               ///< host time at which the newest edge was read
};

/// Which of the trigger edges that arrive over the link are passed on, and to which cameras.
struct ImuEdges {
  std::span<EdgeRing* const> cameras = {};
  bool rising = true;
  std::optional<std::uint8_t> line = {};  ///< empty: all lines
};

class ImuThread {
 public:
  /// `delay`: least time from measurement to arrival. `rate`: expected samples per second; 0: unknown.
  ImuThread(std::string name, std::unique_ptr<ImuLink> link, const ImuCorrection& correction, Duration delay,
            double rate = 0);

  DeviceFault open() { return link_->open(); }
  /// Deviations of the device from its settings, after open().
  std::vector<DeviceFault> warnings() {
    std::vector<DeviceFault> all;
    for (DeviceFault remark; link_->nextRemark(remark);) all.push_back(remark);
    return all;
  }
  void run(SensorSink& sink, const ImuEdges& edges, const RunControl& control);
  [[nodiscard]] SensorInput::Level level() const {
    return link_->allocates() ? SensorInput::Level::kLibrary : SensorInput::Level::kSensor;
  }
  /// Beats at each turn of run().
  [[nodiscard]] Heartbeat& heart() { return heart_; }

  [[nodiscard]] DeviceJournal& journal() { return journal_; }
  [[nodiscard]] const ImuLink& link() const { return *link_; }
  /// Any thread: angular rate without vibration.
  [[nodiscard]] const NewestShared<TurnRate>& turnRate() const { return turn_rate_; }
  [[nodiscard]] ImuStatus status() const {
    ImuStatus status;
    static_cast<void>(status_.read(status));
    return status;
  }

 private:
  void takeReadings(SensorSink& sink, const ImuEdges& edges);
  void hand(const ImuReading& reading, SensorSink& sink);
  [[nodiscard]] bool stampOf(const ImuReading& reading, Stamp& stamp);
  /// Host stamp by the protocol's clock exchange, if that is certain and the arrivals do not contradict it.
  [[nodiscard]] std::optional<Stamp> byExchange(Stamp device, Stamp one_way) const;
  /// Host stamp of other events on the sensor's clock, mapped like samples.
  [[nodiscard]] std::optional<Stamp> hostOf(Stamp device) const;
  void hear();
  void watchSilence(Stamp now);
  void watchQuality(std::size_t readings);
  void watchRate();
  /// Restarts a device that is silent or has lost most of its rate: it may have lost power and its
  /// configuration.
  void restart(Stamp now);

  std::unique_ptr<ImuLink> link_;
  Heartbeat heart_;
  DeviceJournal journal_;
  ImuCorrection correction_;
  Duration delay_;
  ClockMap clock_;
  RateWatch rate_;
  bool was_at_rate_ = false;         ///< it has reached the least rate once
  std::optional<Stamp> slow_since_;  ///< below the least rate since then
  Duration restart_wait_;            ///< until the next restart; grows while restarts do not help
  Stamp restart_at_;                 ///< earliest time of the next restart
  /// Difference between the one-way clock map and the two-way exchange when both were last trusted, at
  /// `agreed_`. After a clock step it is subtracted until the exchange is certain again.
  std::optional<Duration> transport_;
  Stamp agreed_;
  Stamp arrival_;               ///< of the newest reading with a clock
  Stamp newest_;                ///< when the newest sample was handed over, or when waiting began
  Stamp heard_;                 ///< when the newest sample was handed over, or since when there is none
  std::uint64_t received_ = 0;  ///< at `heard_`
  std::uint64_t refused_ = 0;   ///< at `heard_`
  ImuStatus counted_;
  NewestShared<ImuStatus> status_;
  Eigen::Vector3d turning_ = Eigen::Vector3d::Zero();  ///< rad/s, smoothed
  NewestShared<TurnRate> turn_rate_;
};

}  // namespace swiftlet
