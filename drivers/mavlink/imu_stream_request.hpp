#pragma once
// Keeps an autopilot sending inertial samples at a rate: decides what to request and when.
//
// Inputs: messages and the clock. Output: COMMAND_LONG (MAV_CMD_SET_MESSAGE_INTERVAL).
// - Requests start with the autopilot's first HEARTBEAT, and again after kGone without one: an autopilot
//   forgets them at a restart.
// - The samples of each second are counted. Below kReached of the rate the request is repeated; if the rate
//   is still too low, 1.25 times as much is requested, up to twice: autopilots drop messages and round
//   intervals.
// - HIGHRES_IMU first. After three seconds without any, or one second if the autopilot refused it, RAW_IMU is
//   requested, then SCALED_IMU, then HIGHRES_IMU again.
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
  /// Three heartbeats.
  static constexpr Duration kGone = Duration::fromMilliseconds(3000);

  /// `rate`: readings a second that are wanted [Hz]; 0: nothing is ever asked.
  explicit ImuStreamRequest(double rate) : rate_(rate) {}

  void hear(const mavlink::Heartbeat& heartbeat, std::uint8_t system, std::uint8_t component, Stamp now);
  void hear(const mavlink::CommandAck& ack, std::uint8_t system);
  /// `readings` more samples of message() have arrived.
  void count(std::uint64_t readings) { count_ += readings; }
  /// What is to be sent now, if anything.
  std::optional<mavlink::CommandLong> step(Stamp now);

  /// The message that readings are to be taken from.
  [[nodiscard]] std::uint32_t message() const;
  [[nodiscard]] const char* messageName() const;
  /// Rate last requested, 0 before; and rate received in the last full second [Hz].
  [[nodiscard]] double asked() const { return asked_; }
  [[nodiscard]] double seen() const { return seen_; }
  /// The answer to the last question; empty: none yet.
  [[nodiscard]] std::optional<std::uint8_t> result() const { return result_; }
  /// The autopilot, once heard.
  [[nodiscard]] std::optional<std::uint8_t> system() const { return system_; }
  /// What a user should know since the last call: that another message is taken, that the rate is not
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
  std::size_t choice_ = 0;  ///< of the messages
  double factor_ = 1;       ///< of the rate
  double asked_ = 0;
  double seen_ = 0;
  int misses_ = 0;  ///< seconds in a row without the rate
  bool ask_ = false;
  std::optional<std::uint8_t> result_;
  Stamp window_;
  std::uint64_t count_ = 0;
  bool told_ = false;  ///< that the rate is not reached
  std::optional<DeviceFault> remark_;
};

}  // namespace swiftlet
