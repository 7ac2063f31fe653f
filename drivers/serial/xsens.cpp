#include "drivers/serial/xsens.hpp"

#include <optional>

#include "drivers/device/byte_fields.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kPreamble = 0xFA;
constexpr std::uint8_t kBusId = 0xFF;
constexpr std::uint8_t kMtData2 = 0x36;
constexpr std::uint8_t kExtended = 0xFF;
constexpr std::size_t kHeader = 4;
constexpr std::size_t kExtendedHeader = 6;
constexpr std::int64_t kNsPerTick = 100'000;

/// Number format in the low two bits of an item's identifier; the next two are the coordinate frame, which is
/// ignored.
enum Format : unsigned { kFloat32, kFixed1220, kFixed1632, kFloat64 };
constexpr unsigned kFormatMask = 0x3;
constexpr unsigned kTypeMask = 0xFFF0;

enum Item : unsigned {
  kPacketCounter = 0x1020,
  kSampleTimeFine = 0x1060,
  kAcceleration = 0x4020,
  kAccelerationHr = 0x4040,
  kRateOfTurn = 0x8020,
  kRateOfTurnHr = 0x8040,
  kTriggerIn1 = 0x4810,
  kTriggerIn2 = 0x4820,
  kTriggerIn3 = 0x4830,
};

double number(unsigned format, BigFieldReader& from) {
  constexpr double kTwoTo20 = 1U << 20U;
  constexpr double kTwoTo32 = 4294967296.0;
  switch (format) {
    case kFixed1220:
      return from.i32() / kTwoTo20;
    case kFixed1632: {
      const double fraction = from.u32() / kTwoTo32;
      return from.i16() + fraction;
    }
    case kFloat64:
      return from.f64();
    default:
      return from.f32();
  }
}

/// Empty if the item's length is not that of three numbers.
std::optional<Eigen::Vector3d> vector(unsigned format, std::span<const std::uint8_t> data) {
  constexpr std::size_t kSizes[] = {4, 4, 6, 8};
  if (data.size() != 3 * kSizes[format]) return {};
  BigFieldReader from(data);
  const double x = number(format, from), y = number(format, from), z = number(format, from);
  return Eigen::Vector3d(x, y, z);
}

struct Trigger {
  std::uint8_t line = 0;
  std::uint8_t polarity = 0;
  std::uint32_t ticks = 0;
  std::uint16_t frame = 0;
};

/// Reads line, polarity (1 rising, 2 falling), fine ticks and frame number.
std::optional<Trigger> trigger(std::span<const std::uint8_t> data) {
  constexpr std::size_t kSize = 8;
  if (data.size() != kSize) return {};
  BigFieldReader from(data);
  Trigger trigger;
  trigger.line = from.u8();
  trigger.polarity = from.u8();
  trigger.ticks = from.u32();
  trigger.frame = from.u16();
  return trigger;
}

std::span<const std::uint8_t> dataOf(std::span<const std::uint8_t> frame) {
  const std::size_t header = frame[3] == kExtended ? kExtendedHeader : kHeader;
  return frame.subspan(header, frame.size() - header - 1);
}

}  // namespace

FrameCheck Xsens::check(std::span<const std::uint8_t> bytes) {
  if (bytes.empty() || bytes[0] != kPreamble) return {};
  if (bytes.size() < 2) return {FrameVerdict::kIncomplete, 0};
  if (bytes[1] != kBusId) return {};
  if (bytes.size() < kHeader) return {FrameVerdict::kIncomplete, 0};
  std::size_t length = kHeader + bytes[3] + 1;
  if (bytes[3] == kExtended) {
    if (bytes.size() < kExtendedHeader) return {FrameVerdict::kIncomplete, 0};
    const std::size_t data = BigFieldReader(bytes.subspan(kHeader, 2)).u16();
    if (data < kExtended || data > kLongestData) return {};
    length = kExtendedHeader + data + 1;
  }
  if (bytes.size() < length) return {FrameVerdict::kIncomplete, 0};
  unsigned sum = 0;
  for (const std::uint8_t byte : bytes.subspan(1, length - 1)) sum += byte;
  return {(sum & 0xFFU) == 0 ? FrameVerdict::kWhole : FrameVerdict::kBadChecksum, length};
}

void Xsens::read(std::span<const std::uint8_t> frame, InertialFrame& content) {
  if (frame[2] != kMtData2) {
    content.known = false;
    return;
  }
  std::optional<Eigen::Vector3d> gyro_hr, accel_hr;
  FixedVector<Trigger, 3> triggers;
  auto data = dataOf(frame);
  constexpr std::size_t kItemHeader = 3;
  while (data.size() >= kItemHeader) {
    BigFieldReader header(data);
    const unsigned id = header.u16();
    const std::size_t size = header.u8();
    // An item that extends past the end invalidates only the rest, not the items before it.
    if (size > data.size() - kItemHeader) break;
    const auto item = data.subspan(kItemHeader, size);
    data = data.subspan(kItemHeader + size);
    BigFieldReader from(item);
    switch (id & kTypeMask) {
      case kPacketCounter:
        if (size == 2) content.counter = packets_.unwrap(from.u16());
        break;
      case kSampleTimeFine:
        if (size == 4) content.device = Stamp{clock_.unwrap(from.u32()) * kNsPerTick};
        break;
      case kAcceleration:
        content.accel = vector(id & kFormatMask, item);
        break;
      case kRateOfTurn:
        content.gyro = vector(id & kFormatMask, item);
        break;
      case kAccelerationHr:
        accel_hr = vector(id & kFormatMask, item);
        break;
      case kRateOfTurnHr:
        gyro_hr = vector(id & kFormatMask, item);
        break;
      case kTriggerIn1:
      case kTriggerIn2:
      case kTriggerIn3:
        if (const auto read = trigger(item)) (void)triggers.tryPushBack(*read);
        break;
      default:
        break;
    }
  }
  if (!content.accel && !content.gyro) {
    content.accel = accel_hr;
    content.gyro = gyro_hr;
  }
  // After the whole message: the trigger item can precede the clock that it refers to.
  for (const Trigger& read : triggers) {
    constexpr std::uint8_t kRising = 1;
    TriggerEdge edge;
    edge.device = Stamp{clock_.near(read.ticks) * kNsPerTick};
    edge.counter = trigger_frames_.unwrap(read.frame);
    edge.line = read.line;
    edge.rising = read.polarity == kRising;
    (void)content.edges.tryPushBack(edge);
  }
}

std::size_t encodeXsens(const ImuReading& reading, std::span<std::uint8_t> out) {
  constexpr std::uint8_t kVectorSize = 12;
  BigFieldWriter to(out);
  to.u8(kPreamble);
  to.u8(kBusId);
  to.u8(kMtData2);
  constexpr std::uint8_t kDataLength = 5 + 7 + 2 * (3 + kVectorSize);
  to.u8(kDataLength);
  to.u16(kPacketCounter);
  to.u8(2);
  to.u16(static_cast<std::uint16_t>(reading.counter.value_or(0) & 0xFFFFU));
  to.u16(kSampleTimeFine);
  to.u8(4);
  to.u32(static_cast<std::uint32_t>(reading.device.value_or(reading.arrival).ns / kNsPerTick));
  to.u16(kAcceleration);
  to.u8(kVectorSize);
  to.vectorF32(reading.accel);
  to.u16(kRateOfTurn);
  to.u8(kVectorSize);
  to.vectorF32(reading.gyro);
  if (!to.ok()) return 0;
  unsigned sum = 0;
  for (const std::uint8_t byte : to.written().subspan(1)) sum += byte;
  to.u8(static_cast<std::uint8_t>(-sum & 0xFFU));
  return to.ok() ? to.written().size() : 0;
}

}  // namespace swiftlet
