#include "drivers/mavlink/vision_messages.hpp"

#include <cmath>

#include "drivers/mavlink/message_fields.hpp"

namespace swiftlet::mavlink {
namespace {

constexpr std::size_t kSectors = ObstacleDistance::kSectors;

void put(LittleFieldWriter& to, std::span<const float> values) {
  for (const float value : values) to.f32(value);
}

void take(LittleFieldReader& from, std::span<float> values) {
  for (float& value : values) value = from.f32();
}

}  // namespace

bool read(const MavlinkFrame& frame, Odometry& message) {
  if (frame.message != Odometry::kId) return false;
  LittleFieldReader from = reader(frame);
  message.time_usec = from.u64();
  message.position = vector(from);
  take(from, message.q);
  message.velocity = vector(from);
  message.rates = vector(from);
  take(from, message.pose_covariance);
  take(from, message.velocity_covariance);
  message.frame = static_cast<Frame>(from.u8());
  message.child = static_cast<Frame>(from.u8());
  message.reset_counter = from.u8();
  message.estimator = from.u8();
  message.quality = static_cast<std::int8_t>(from.u8());
  return true;
}

bool read(const MavlinkFrame& frame, VisionPositionEstimate& message) {
  if (frame.message != VisionPositionEstimate::kId) return false;
  LittleFieldReader from = reader(frame);
  message.usec = from.u64();
  message.position = vector(from);
  message.rpy = vector(from);
  take(from, message.covariance);
  message.reset_counter = from.u8();
  return true;
}

bool read(const MavlinkFrame& frame, ObstacleDistance& message) {
  if (frame.message != ObstacleDistance::kId) return false;
  LittleFieldReader from = reader(frame);
  message.time_usec = from.u64();
  for (std::uint16_t& distance : message.distance_cm) distance = from.u16();
  message.min_cm = from.u16();
  message.max_cm = from.u16();
  message.sensor = from.u8();
  const std::uint8_t whole_degrees = from.u8();
  message.increment_deg = from.f32();
  if (message.increment_deg == 0) message.increment_deg = whole_degrees;
  message.offset_deg = from.f32();
  message.frame = static_cast<Frame>(from.u8());
  return true;
}

bool read(const MavlinkFrame& frame, StatusText& message) {
  if (frame.message != StatusText::kId) return false;
  LittleFieldReader from = reader(frame);
  message.severity = static_cast<StatusText::Severity>(from.u8());
  const std::string_view text(reinterpret_cast<const char*>(frame.payload.data()) + 1, StatusText::kMostText);
  message.text = text.substr(0, text.find('\0'));
  for (std::size_t i = 0; i < StatusText::kMostText; ++i) from.u8();
  message.id = from.u16();
  message.chunk = from.u8();
  return true;
}

std::size_t write(MavlinkSender& sender, const Odometry& message, std::span<std::uint8_t> out) {
  Payload payload;
  LittleFieldWriter& to = payload.fields;
  to.u64(message.time_usec);
  put(to, message.position);
  put(to, std::span(message.q));
  put(to, message.velocity);
  put(to, message.rates);
  put(to, std::span(message.pose_covariance));
  put(to, std::span(message.velocity_covariance));
  to.u8(static_cast<std::uint8_t>(message.frame));
  to.u8(static_cast<std::uint8_t>(message.child));
  to.u8(message.reset_counter);
  to.u8(message.estimator);
  to.u8(static_cast<std::uint8_t>(message.quality));
  return payload.finish(sender, Odometry::kId, out);
}

std::size_t write(MavlinkSender& sender, const VisionPositionEstimate& message, std::span<std::uint8_t> out) {
  Payload payload;
  LittleFieldWriter& to = payload.fields;
  to.u64(message.usec);
  put(to, message.position);
  put(to, message.rpy);
  put(to, std::span(message.covariance));
  to.u8(message.reset_counter);
  return payload.finish(sender, VisionPositionEstimate::kId, out);
}

std::size_t write(MavlinkSender& sender, const ObstacleDistance& message, std::span<std::uint8_t> out) {
  Payload payload;
  LittleFieldWriter& to = payload.fields;
  to.u64(message.time_usec);
  for (std::size_t i = 0; i < kSectors; ++i) to.u16(message.distance_cm[i]);
  to.u16(message.min_cm);
  to.u16(message.max_cm);
  to.u8(message.sensor);
  // Receivers of the message's first version read only whole degrees.
  to.u8(static_cast<std::uint8_t>(std::lround(message.increment_deg)));
  to.f32(message.increment_deg);
  to.f32(message.offset_deg);
  to.u8(static_cast<std::uint8_t>(message.frame));
  return payload.finish(sender, ObstacleDistance::kId, out);
}

std::size_t write(MavlinkSender& sender, const StatusText& message, std::span<std::uint8_t> out) {
  Payload payload;
  LittleFieldWriter& to = payload.fields;
  to.u8(static_cast<std::uint8_t>(message.severity));
  for (std::size_t i = 0; i < StatusText::kMostText; ++i) {
    to.u8(i < message.text.size() ? static_cast<std::uint8_t>(message.text[i]) : 0);
  }
  to.u16(message.id);
  to.u8(message.chunk);
  return payload.finish(sender, StatusText::kId, out);
}

}  // namespace swiftlet::mavlink
