#include "drivers/serial/mip.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "drivers/device/byte_fields.hpp"
#include "drivers/serial/device_count.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kSync1 = 0x75;
constexpr std::uint8_t kSync2 = 0x65;
constexpr std::size_t kHeader = 4;
constexpr std::size_t kFieldHeader = 2;
constexpr std::size_t kChecksum = 2;
constexpr std::size_t kLongestPayload = 255;
constexpr std::uint8_t kSensorData = 0x80;
constexpr double kStandardGravity = 9.80665;  // [m/s^2], exact by definition

enum Field : std::uint8_t {
  kAccel = 0x04,
  kGyro = 0x05,
  kDeltaTheta = 0x07,
  kDeltaVelocity = 0x08,
  kOldGpsStamp = 0x12,
  kGpsTime = 0xD3,
  kDeltaTime = 0xD4,
  kReferenceTime = 0xD5,
  kReferenceDelta = 0xD6,
  kExternalTime = 0xD7,
};

std::uint16_t fletcher(std::span<const std::uint8_t> bytes) {
  unsigned a = 0, b = 0;
  for (const std::uint8_t byte : bytes) {
    a += byte;
    b += a;
  }
  return static_cast<std::uint16_t>(((a & 0xFFU) << 8U) | (b & 0xFFU));
}

struct GpsFlags {
  unsigned tow_valid, week_valid;
};

/// Empty for impossible times: negative, not finite, or too large.
std::optional<Stamp> gpsStamp(BigFieldReader from, GpsFlags flags) {
  constexpr double kLongestTow = 1e7;  // [s]; a week has 604800, free-running clocks may pass it
  constexpr std::int64_t kNsPerWeek = 604'800'000'000'000;
  constexpr unsigned kLastWeek = 10'000;
  const double tow = from.f64();
  const unsigned week = from.u16();
  const unsigned flag = from.u16();
  if (!(tow >= 0 && tow < kLongestTow) || week > kLastWeek) return {};
  const bool has_week = (flag & flags.tow_valid) != 0 && (flag & flags.week_valid) != 0;
  const std::int64_t weeks = has_week ? static_cast<std::int64_t>(week) * kNsPerWeek : 0;
  return Stamp{weeks + std::llround(tow * 1e9)};
}

/// Content of one packet before the preferred fields are selected.
struct Packet {
  std::optional<Eigen::Vector3d> accel_g, gyro, delta_theta, delta_velocity_g;
  std::optional<std::uint64_t> reference, external;
  std::optional<Stamp> gps, old_gps;
  std::optional<double> delta_time;
  bool in_range = true;
};

void readField(std::uint8_t descriptor, std::span<const std::uint8_t> data, Packet& packet) {
  constexpr std::size_t kVectorSize = 12, kGpsSize = 12, kLongSize = 8, kExternalSize = 10;
  BigFieldReader from(data);
  switch (descriptor) {
    case kAccel:
      if (data.size() == kVectorSize) packet.accel_g = from.vectorF32();
      break;
    case kGyro:
      if (data.size() == kVectorSize) packet.gyro = from.vectorF32();
      break;
    case kDeltaTheta:
      if (data.size() == kVectorSize) packet.delta_theta = from.vectorF32();
      break;
    case kDeltaVelocity:
      if (data.size() == kVectorSize) packet.delta_velocity_g = from.vectorF32();
      break;
    case kOldGpsStamp:
      if (data.size() != kGpsSize) break;
      packet.old_gps = gpsStamp(from, {8, 16});
      packet.in_range = packet.in_range && packet.old_gps;
      break;
    case kGpsTime:
      if (data.size() != kGpsSize) break;
      packet.gps = gpsStamp(from, {1, 2});
      packet.in_range = packet.in_range && packet.gps;
      break;
    case kDeltaTime:
      if (data.size() == kLongSize && !packet.delta_time) packet.delta_time = from.f64();
      break;
    case kReferenceTime:
      if (data.size() == kLongSize) packet.reference = from.u64();
      break;
    case kReferenceDelta:
      if (data.size() == kLongSize) packet.delta_time = static_cast<double>(from.u64()) * 1e-9;
      break;
    case kExternalTime:
      if (data.size() == kExternalSize) {
        const std::uint64_t time = from.u64();
        if (from.u16() != 0) packet.external = time;
      }
      break;
    default:
      break;
  }
}

}  // namespace

FrameCheck Mip::check(std::span<const std::uint8_t> bytes) {
  if (bytes.empty() || bytes[0] != kSync1) return {};
  if (bytes.size() < 2) return {FrameVerdict::kIncomplete, 0};
  if (bytes[1] != kSync2) return {};
  if (bytes.size() < kHeader) return {FrameVerdict::kIncomplete, 0};
  const std::size_t length = kHeader + bytes[3] + kChecksum;
  if (bytes.size() < length) return {FrameVerdict::kIncomplete, 0};
  const std::uint16_t carried = BigFieldReader(bytes.subspan(length - kChecksum, kChecksum)).u16();
  const bool right = fletcher(bytes.first(length - kChecksum)) == carried;
  return {right ? FrameVerdict::kWhole : FrameVerdict::kBadChecksum, length};
}

void Mip::read(std::span<const std::uint8_t> frame, InertialFrame& content) {
  if (frame[2] != kSensorData) {
    content.known = false;
    return;
  }
  Packet packet;
  auto payload = frame.subspan(kHeader, frame.size() - kHeader - kChecksum);
  while (payload.size() >= kFieldHeader) {
    const std::size_t length = payload[0];
    if (length < kFieldHeader || length > payload.size()) break;
    readField(payload[1], payload.subspan(kFieldHeader, length - kFieldHeader), packet);
    payload = payload.subspan(length);
  }

  content.in_range = packet.in_range;
  content.gyro = packet.gyro;
  if (packet.accel_g) content.accel = *packet.accel_g * kStandardGravity;
  if (!content.gyro && !content.accel && packet.delta_time) {
    if (packet.delta_theta) content.gyro = *packet.delta_theta / *packet.delta_time;
    if (packet.delta_velocity_g)
      content.accel = *packet.delta_velocity_g * kStandardGravity / *packet.delta_time;
  }
  if (packet.reference) {
    content.device = stampOf(*packet.reference, 1);
    content.in_range = content.in_range && content.device;
  } else if (packet.gps) {
    content.device = packet.gps;
  } else if (packet.old_gps) {
    content.device = packet.old_gps;
  } else if (packet.external) {
    content.device = stampOf(*packet.external, 1);
    content.in_range = content.in_range && content.device;
  }
}

MipWriter::MipWriter(std::span<std::uint8_t> out, std::uint8_t descriptor_set) : out_(out) {
  fits_ = out.size() >= kHeader;
  if (!fits_) return;
  out_[0] = kSync1;
  out_[1] = kSync2;
  out_[2] = descriptor_set;
}

void MipWriter::field(std::uint8_t descriptor, std::span<const std::uint8_t> data) {
  const std::size_t size = kFieldHeader + data.size();
  fits_ = fits_ && size <= kLongestPayload && length_ - kHeader + size <= kLongestPayload &&
          length_ + size <= out_.size();
  if (!fits_) return;
  out_[length_] = static_cast<std::uint8_t>(size);
  out_[length_ + 1] = descriptor;
  std::copy(data.begin(), data.end(), out_.begin() + static_cast<std::ptrdiff_t>(length_ + kFieldHeader));
  length_ += size;
}

std::size_t MipWriter::finish() {
  if (!fits_ || out_.size() < length_ + kChecksum) return 0;
  out_[3] = static_cast<std::uint8_t>(length_ - kHeader);
  BigFieldWriter(out_.subspan(length_, kChecksum)).u16(fletcher(out_.first(length_)));
  return length_ + kChecksum;
}

std::size_t encodeMip(const ImuReading& reading, std::span<std::uint8_t> out) {
  std::array<std::uint8_t, 12> data = {};
  MipWriter packet(out, kSensorData);
  BigFieldWriter time(data);
  time.u64(static_cast<std::uint64_t>(reading.device.value_or(reading.arrival).ns));
  packet.field(kReferenceTime, time.written());
  BigFieldWriter(data).vectorF32(reading.accel / kStandardGravity);
  packet.field(kAccel, data);
  BigFieldWriter(data).vectorF32(reading.gyro);
  packet.field(kGyro, data);
  return packet.finish();
}

}  // namespace swiftlet
