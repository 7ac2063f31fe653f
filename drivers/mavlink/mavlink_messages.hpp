#pragma once
// The MAVLink messages that swiftlet reads or writes, field for field, in MAVLink's own units.
//
// read(frame, message): false if the frame holds another message. Fields that were not sent (trailing zeros,
// extensions of version 1) are zero. write(sender, message, out): one version 2 frame; returns its length, or
// 0 if `out` is too short. Offsets and units: docs/mavlink.md. Source: MAVLink common.xml.

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/mavlink/mavlink_frame.hpp"

namespace swiftlet::mavlink {

/// HIGHRES_IMU: forward-right-down axes; at rest and level z is about -9.81.
struct HighresImu {
  static constexpr std::uint32_t kId = 105;
  static constexpr std::uint16_t kAccelUpdated = 0x07;  ///< bits of fields_updated
  static constexpr std::uint16_t kGyroUpdated = 0x38;

  std::uint64_t time_usec = 0;                      ///< [us] since boot or, from some senders, since 1970
  Eigen::Vector3f accel = Eigen::Vector3f::Zero();  ///< [m/s^2]
  Eigen::Vector3f gyro = Eigen::Vector3f::Zero();   ///< [rad/s]
  Eigen::Vector3f mag = Eigen::Vector3f::Zero();    ///< [gauss]
  float abs_pressure = 0;                           ///< [hPa]
  float diff_pressure = 0;                          ///< [hPa]
  float pressure_alt = 0;                           ///< [m]
  float temperature = 0;                            ///< [degC]
  std::uint16_t fields_updated = 0;
  std::uint8_t id = 0;  ///< number of the sender's sensor; extension
};

/// SCALED_IMU and RAW_IMU of sensor 0 in ArduPilot's units: thousandths, forward-right-down axes.
struct ScaledImu {
  static constexpr std::uint32_t kScaledId = 26;
  static constexpr std::uint32_t kRawId = 27;
  static constexpr double kMetresPerSecond2 = 9.80665e-3;  ///< per unit of `accel`
  static constexpr double kRadPerSecond = 1e-3;            ///< per unit of `gyro`
  using Vector = Eigen::Matrix<std::int16_t, 3, 1>;

  std::uint64_t time_usec = 0;    ///< [us]; SCALED_IMU has whole milliseconds
  Vector accel = Vector::Zero();  ///< [mg]
  Vector gyro = Vector::Zero();   ///< [mrad/s]
  std::uint8_t id = 0;            ///< RAW_IMU only; extension
};

/// TIMESYNC: a request has tc1 = 0 and its sender's clock in ts1. The answer repeats ts1 and has the
/// answerer's clock in tc1.
struct Timesync {
  static constexpr std::uint32_t kId = 111;
  std::int64_t tc1 = 0;               ///< [ns]
  std::int64_t ts1 = 0;               ///< [ns]
  std::uint8_t target_system = 0;     ///< extension
  std::uint8_t target_component = 0;  ///< extension
};

struct Heartbeat {
  static constexpr std::uint32_t kId = 0;
  static constexpr std::uint8_t kNoAutopilot = 8;  ///< MAV_AUTOPILOT_INVALID
  static constexpr std::uint8_t kPx4 = 12;         ///< MAV_AUTOPILOT_PX4
  std::uint32_t custom_mode = 0;
  std::uint8_t type = 18;  ///< MAV_TYPE_ONBOARD_CONTROLLER
  std::uint8_t autopilot = kNoAutopilot;
  std::uint8_t base_mode = 0;
  std::uint8_t system_status = 4;  ///< MAV_STATE_ACTIVE; 5 is CRITICAL
  std::uint8_t mavlink_version = 3;
};

struct CommandLong {
  static constexpr std::uint32_t kId = 76;
  /// MAV_CMD_SET_MESSAGE_INTERVAL: param[0] is the message, param[1] the interval [us].
  static constexpr std::uint16_t kSetMessageInterval = 511;
  std::array<float, 7> param = {};
  std::uint16_t command = 0;
  std::uint8_t target_system = 1;
  std::uint8_t target_component = 1;
  std::uint8_t confirmation = 0;
};

/// The first three bytes of COMMAND_ACK: command and result (0 = accepted).
struct CommandAck {
  static constexpr std::uint32_t kId = 77;
  static constexpr std::uint8_t kAccepted = 0;    ///< MAV_RESULT_ACCEPTED
  static constexpr std::uint8_t kInProgress = 5;  ///< MAV_RESULT_IN_PROGRESS
  std::uint16_t command = 0;
  std::uint8_t result = 0;
};

struct CameraTrigger {
  static constexpr std::uint32_t kId = 112;
  std::uint64_t time_usec = 0;
  std::uint32_t seq = 0;
};

bool read(const MavlinkFrame& frame, HighresImu& message);
bool read(const MavlinkFrame& frame, ScaledImu& message);
bool read(const MavlinkFrame& frame, Timesync& message);
bool read(const MavlinkFrame& frame, Heartbeat& message);
bool read(const MavlinkFrame& frame, CommandLong& message);
bool read(const MavlinkFrame& frame, CommandAck& message);
bool read(const MavlinkFrame& frame, CameraTrigger& message);

std::size_t write(MavlinkSender& sender, const HighresImu& message, std::span<std::uint8_t> out);
std::size_t write(MavlinkSender& sender, const Timesync& message, std::span<std::uint8_t> out);
std::size_t write(MavlinkSender& sender, const Heartbeat& message, std::span<std::uint8_t> out);
std::size_t write(MavlinkSender& sender, const CommandLong& message, std::span<std::uint8_t> out);
std::size_t write(MavlinkSender& sender, const CameraTrigger& message, std::span<std::uint8_t> out);

}  // namespace swiftlet::mavlink
