#pragma once
// Keeps an autopilot sending inertial samples at a rate: decides what to request and when.
//
// Inputs: messages and the clock. Output: COMMAND_LONG (MAV_CMD_SET_MESSAGE_INTERVAL).
// - Requests start with the autopilot's first HEARTBEAT, and again after kGone without one, because an
//   autopilot forgets them when it restarts.
// - The samples of each second are counted. Below kReached of the rate the request is repeated. If the rate
//   is still too low, it is requested higher by 1.25 each time, up to twice the rate: autopilots drop
//   messages and round intervals.
// - HIGHRES_IMU is requested first. After three seconds without any, or one second if the autopilot refused
//   it, RAW_IMU is requested, then SCALED_IMU, then HIGHRES_IMU again.
//
// Memory: no allocation. Cost: O(1). Source: MAVLink common.xml; docs/mavlink.md.

#include <cstdint>
#include <optional>

#include "drivers/device/device_fault.hpp"
#include "drivers/mavlink/mavlink_messages.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class ImuStreamRequest {
 public:
  static constexpr double kReached = 0.95;
  /// Duration of three heartbeats.
  static constexpr Duration kGone = Duration::fromMilliseconds(3000);

  /// `rate`: required readings per second [Hz]; 0: nothing is requested.
  explicit ImuStreamRequest(double rate) : rate_(rate) {}

  void hear(const mavlink::Heartbeat& heartbeat, std::uint8_t system, std::uint8_t component, Stamp now);
  void hear(const mavlink::CommandAck& ack, std::uint8_t system);
  /// `readings` more samples of message() have arrived.
  void count(std::uint64_t readings) { count_ += readings; }
  /// The request to be sent now, if any.
  std::optional<mavlink::CommandLong> step(Stamp now);

  /// The message from which readings must be taken.
  [[nodiscard]] std::uint32_t message() const;
  [[nodiscard]] const char* messageName() const;
  /// `asked`: rate last requested, 0 before; `seen`: rate received in the last full second [Hz].
  [[nodiscard]] double asked() const { return asked_; }
  [[nodiscard]] double seen() const { return seen_; }
  /// Result of the last request; empty: no answer yet.
  [[nodiscard]] std::optional<std::uint8_t> result() const { return result_; }
  /// System id of the autopilot, once heard.
  [[nodiscard]] std::optional<std::uint8_t> system() const { return system_; }
  /// A message for the user since the last call: that another message is requested, or that the rate is not
  /// reached.
  bool nextRemark(DeviceFault& remark);

 private:
  void begin();
  void judge(Stamp now);
  void takeNextMessage();

  double rate_;
  std::optional<std::uint8_t> system_;
  std::uint8_t component_ = 1;
  Stamp heartbeat_;
  std::size_t choice_ = 0;  ///< index of the requested message
  double factor_ = 1;       ///< requested rate / required rate
  double asked_ = 0;
  double seen_ = 0;
  int misses_ = 0;  ///< consecutive seconds below the rate
  bool ask_ = false;
  std::optional<std::uint8_t> result_;
  Stamp window_;
  std::uint64_t count_ = 0;
  bool told_ = false;  ///< the user was told that the rate is not reached
  std::optional<DeviceFault> remark_;
};

}  // namespace swiftlet
