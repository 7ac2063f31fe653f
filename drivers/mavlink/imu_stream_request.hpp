#pragma once
// Keeps an autopilot sending inertial readings at a rate: what is asked of it, and when.
//
// Messages and the clock in, COMMAND_LONG (MAV_CMD_SET_MESSAGE_INTERVAL) out.
// - Asked when the autopilot's HEARTBEAT is heard first, or again after kGone without one: it forgets at a
//   restart.
// - Each second the readings are counted. Below kReached of the rate the same is asked again; still below,
//   1.25 times as much, up to twice: autopilots leave messages out, and round intervals.
// - HIGHRES_IMU first. Where three seconds bring none, or one does and the autopilot refused it, RAW_IMU is
//   asked for, then SCALED_IMU, then HIGHRES_IMU again.
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
  /// `readings` more have come of message().
  void count(std::uint64_t readings) { count_ += readings; }
  /// What is to be sent now, if anything.
  std::optional<mavlink::CommandLong> step(Stamp now);

  /// The message that readings are to be taken from.
  [[nodiscard]] std::uint32_t message() const;
  [[nodiscard]] const char* messageName() const;
  /// Last asked for, 0 before; and what came in the last whole second [Hz].
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
