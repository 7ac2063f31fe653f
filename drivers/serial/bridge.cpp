#include "drivers/serial/bridge.hpp"

#include "drivers/device/byte_fields.hpp"
#include "drivers/device/crc16.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kSync1 = 0xA9;
constexpr std::uint8_t kSync2 = 0x1C;
constexpr std::size_t kHeader = 4;
constexpr std::size_t kCrc = 2;
constexpr std::uint8_t kSample = 0x11;  // version 1, kind 1
constexpr std::uint8_t kEdge = 0x12;    // version 1, kind 2
constexpr std::uint8_t kSampleLength = 36;
constexpr std::uint8_t kSampleWithTemperature = 40;
constexpr std::uint8_t kEdgeLength = 14;
constexpr std::uint16_t kCrcStart = 0xFFFF;

LittleFieldWriter begin(std::uint8_t kind, std::uint8_t length, std::span<std::uint8_t> out) {
  LittleFieldWriter to(out);
  to.u8(kSync1);
  to.u8(kSync2);
  to.u8(kind);
  to.u8(length);
  return to;
}

std::size_t finish(LittleFieldWriter& to) {
  if (!to.ok()) return 0;
  to.u16(crc16Ccitt(kCrcStart, to.written().subspan(2)));
  return to.ok() ? to.written().size() : 0;
}

}  // namespace

FrameCheck Bridge::check(std::span<const std::uint8_t> bytes) {
  if (bytes.empty() || bytes[0] != kSync1) return {};
  if (bytes.size() < 2) return {FrameVerdict::kIncomplete, 0};
  if (bytes[1] != kSync2) return {};
  if (bytes.size() < kHeader) return {FrameVerdict::kIncomplete, 0};
  const std::size_t length = kHeader + bytes[3] + kCrc;
  if (bytes.size() < length) return {FrameVerdict::kIncomplete, 0};
  const std::uint16_t carried = LittleFieldReader(bytes.subspan(length - kCrc, kCrc)).u16();
  const bool right = crc16Ccitt(kCrcStart, bytes.subspan(2, length - kCrc - 2)) == carried;
  return {right ? FrameVerdict::kWhole : FrameVerdict::kBadChecksum, length};
}

void Bridge::read(std::span<const std::uint8_t> frame, InertialFrame& content) {
  const std::uint8_t kind = frame[2];
  const std::size_t length = frame[3];
  content.known = (kind == kSample && length >= kSampleLength) || (kind == kEdge && length >= kEdgeLength);
  if (!content.known) return;
  LittleFieldReader from(frame.subspan(kHeader, length));
  const std::optional<Stamp> time = stampOf(from.u64(), 1);
  content.in_range = time.has_value();
  if (kind == kSample) {
    content.device = time;
    content.counter = samples_.unwrap(from.u32());
    content.gyro = from.vectorF32();
    content.accel = from.vectorF32();
    return;
  }
  if (!time) return;
  TriggerEdge edge;
  edge.device = *time;
  edge.counter = edges_.unwrap(from.u32());
  edge.line = from.u8();
  edge.rising = from.u8() != 0;
  (void)content.edges.tryPushBack(edge);
}

std::size_t encodeBridge(const ImuReading& reading, std::optional<float> temperature,
                         std::span<std::uint8_t> out) {
  LittleFieldWriter to = begin(kSample, temperature ? kSampleWithTemperature : kSampleLength, out);
  to.i64(reading.device.value_or(reading.arrival).ns);
  to.u32(static_cast<std::uint32_t>(reading.counter.value_or(0) & 0xFFFFFFFFU));
  to.vectorF32(reading.gyro);
  to.vectorF32(reading.accel);
  if (temperature) to.f32(*temperature);
  return finish(to);
}

std::size_t encodeBridge(const TriggerEdge& edge, std::span<std::uint8_t> out) {
  LittleFieldWriter to = begin(kEdge, kEdgeLength, out);
  to.i64(edge.device.ns);
  to.u32(static_cast<std::uint32_t>(edge.counter & 0xFFFFFFFFU));
  to.u8(edge.line);
  to.u8(edge.rising.value_or(true) ? 1 : 0);
  return finish(to);
}

}  // namespace swiftlet
