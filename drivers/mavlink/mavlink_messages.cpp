#include "drivers/mavlink/mavlink_messages.hpp"

#include "drivers/mavlink/message_fields.hpp"

namespace swiftlet::mavlink {
bool read(const MavlinkFrame& frame, HighresImu& message) {
  if (frame.message != HighresImu::kId) return false;
  LittleFieldReader from = reader(frame);
  message.time_usec = from.u64();
  message.accel = vector(from);
  message.gyro = vector(from);
  message.mag = vector(from);
  message.abs_pressure = from.f32();
  message.diff_pressure = from.f32();
  message.pressure_alt = from.f32();
  message.temperature = from.f32();
  message.fields_updated = from.u16();
  message.id = from.u8();
  return true;
}

bool read(const MavlinkFrame& frame, ScaledImu& message) {
  const bool raw = frame.message == ScaledImu::kRawId;
  if (!raw && frame.message != ScaledImu::kScaledId) return false;
  constexpr std::uint64_t kUsPerMs = 1000;
  LittleFieldReader from = reader(frame);
  message.time_usec = raw ? from.u64() : kUsPerMs * from.u32();
  for (ScaledImu::Vector* vector : {&message.accel, &message.gyro}) {
    for (int i = 0; i < 3; ++i) (*vector)[i] = from.i16();
  }
  constexpr std::size_t kMagnetometer = 3;
  for (std::size_t i = 0; i < kMagnetometer; ++i) static_cast<void>(from.u16());
  message.id = raw ? from.u8() : 0;
  return true;
}

bool read(const MavlinkFrame& frame, Timesync& message) {
  if (frame.message != Timesync::kId) return false;
  LittleFieldReader from = reader(frame);
  message.tc1 = from.i64();
  message.ts1 = from.i64();
  message.target_system = from.u8();
  message.target_component = from.u8();
  return true;
}

bool read(const MavlinkFrame& frame, Heartbeat& message) {
  if (frame.message != Heartbeat::kId) return false;
  LittleFieldReader from = reader(frame);
  message.custom_mode = from.u32();
  message.type = from.u8();
  message.autopilot = from.u8();
  message.base_mode = from.u8();
  message.system_status = from.u8();
  message.mavlink_version = from.u8();
  return true;
}

bool read(const MavlinkFrame& frame, CommandLong& message) {
  if (frame.message != CommandLong::kId) return false;
  LittleFieldReader from = reader(frame);
  for (float& value : message.param) value = from.f32();
  message.command = from.u16();
  message.target_system = from.u8();
  message.target_component = from.u8();
  message.confirmation = from.u8();
  return true;
}

bool read(const MavlinkFrame& frame, CommandAck& message) {
  if (frame.message != CommandAck::kId) return false;
  LittleFieldReader from = reader(frame);
  message.command = from.u16();
  message.result = from.u8();
  return true;
}

bool read(const MavlinkFrame& frame, CameraTrigger& message) {
  if (frame.message != CameraTrigger::kId) return false;
  LittleFieldReader from = reader(frame);
  message.time_usec = from.u64();
  message.seq = from.u32();
  return true;
}

std::size_t write(MavlinkSender& sender, const HighresImu& message, std::span<std::uint8_t> out) {
  Payload payload;
  payload.fields.u64(message.time_usec);
  put(payload.fields, message.accel);
  put(payload.fields, message.gyro);
  put(payload.fields, message.mag);
  payload.fields.f32(message.abs_pressure);
  payload.fields.f32(message.diff_pressure);
  payload.fields.f32(message.pressure_alt);
  payload.fields.f32(message.temperature);
  payload.fields.u16(message.fields_updated);
  payload.fields.u8(message.id);
  return payload.finish(sender, HighresImu::kId, out);
}

std::size_t write(MavlinkSender& sender, const Timesync& message, std::span<std::uint8_t> out) {
  Payload payload;
  payload.fields.i64(message.tc1);
  payload.fields.i64(message.ts1);
  payload.fields.u8(message.target_system);
  payload.fields.u8(message.target_component);
  return payload.finish(sender, Timesync::kId, out);
}

std::size_t write(MavlinkSender& sender, const Heartbeat& message, std::span<std::uint8_t> out) {
  Payload payload;
  payload.fields.u32(message.custom_mode);
  payload.fields.u8(message.type);
  payload.fields.u8(message.autopilot);
  payload.fields.u8(message.base_mode);
  payload.fields.u8(message.system_status);
  payload.fields.u8(message.mavlink_version);
  return payload.finish(sender, Heartbeat::kId, out);
}

std::size_t write(MavlinkSender& sender, const CommandLong& message, std::span<std::uint8_t> out) {
  Payload payload;
  for (const float value : message.param) payload.fields.f32(value);
  payload.fields.u16(message.command);
  payload.fields.u8(message.target_system);
  payload.fields.u8(message.target_component);
  payload.fields.u8(message.confirmation);
  return payload.finish(sender, CommandLong::kId, out);
}

std::size_t write(MavlinkSender& sender, const CameraTrigger& message, std::span<std::uint8_t> out) {
  Payload payload;
  payload.fields.u64(message.time_usec);
  payload.fields.u32(message.seq);
  return payload.finish(sender, CameraTrigger::kId, out);
}

}  // namespace swiftlet::mavlink
