#pragma once
// The link to an IMU: a serial port or UDP with a protocol, a CAN bus, or topics. Threads: one. Errors:
// values; a lasting fault closes the link, and open() reopens it.

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "drivers/device/device_fault.hpp"
#include "drivers/device/imu_reading.hpp"
#include "drivers/serial/trigger_edge.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class ImuLink {
 public:
  ImuLink() = default;
  ImuLink(const ImuLink&) = delete;
  ImuLink& operator=(const ImuLink&) = delete;
  virtual ~ImuLink() = default;

  virtual DeviceFault open() = 0;
  [[nodiscard]] virtual bool isOpen() const = 0;
  /// Closes the link of a device that may have lost its configuration: open() configures it again. False: the
  /// link stays open, since it configures nothing or does so while it is open.
  virtual bool restart() { return false; }
  /// Whether reading allocates and locks; such a link must not run on a thread of the flight path.
  [[nodiscard]] virtual bool allocates() const { return false; }
  /// Poll for reading.
  [[nodiscard]] virtual int fd() const = 0;
  /// Poll as well: readable while another thread has a message to send; negative: never.
  [[nodiscard]] virtual int wakeFd() const { return -1; }
  /// Discards queued samples whose arrival time is no longer known. Bounded.
  virtual void discard() {}
  /// Reads waiting bytes or messages.
  virtual DeviceFault receive(Stamp now) = 0;
  /// Sends what the protocol requires, after the samples have been taken. Never waits.
  virtual DeviceFault send() { return {}; }
  virtual bool next(ImuReading& reading) = 0;
  /// Trigger edges seen by the IMU. False: none left.
  virtual bool nextEdge(TriggerEdge& /*edge*/) { return false; }
  /// Bytes or frames received so far, of any kind. If they grow without samples, the protocol is wrong.
  [[nodiscard]] virtual std::uint64_t received() const = 0;
  /// Host stamp by the protocol's own clock exchange; empty: there is none, or it is not certain yet.
  [[nodiscard]] virtual std::optional<Stamp> toHost(Stamp /*device*/) const { return std::nullopt; }
  /// Deviations of the device from what was requested, for the user; call until it returns false.
  virtual bool nextRemark(DeviceFault& /*remark*/) { return false; }
  /// What was requested from the device and its answer, as text; empty: nothing was requested.
  [[nodiscard]] virtual std::string stream() const { return {}; }
  /// Counters, after the flight.
  [[nodiscard]] virtual nlohmann::ordered_json counters() const = 0;
};

}  // namespace swiftlet
