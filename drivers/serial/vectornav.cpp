#include "drivers/serial/vectornav.hpp"

#include <array>
#include <numbers>
#include <optional>

#include "drivers/device/byte_fields.hpp"
#include "drivers/device/crc16.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kSync = 0xFA;
constexpr std::size_t kMaskAt = 2;
constexpr std::size_t kCrc = 2;
constexpr double kRadiansPerDegree = std::numbers::pi / 180;

enum Group : std::size_t { kCommon, kTime, kImu, kGroups };

constexpr std::size_t kFields = 16;
/// Bytes of each field of each group; 0: unknown, so the frame's length is unknown.
constexpr std::array<std::array<std::uint8_t, kFields>, kGroups> kSizes = {
    {{8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8},
     {8, 8, 8, 2, 8, 8, 8, 4, 4, 1},
     {2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2}}};

constexpr std::size_t field(Group group, std::size_t bit) { return group * kFields + bit; }

/// Rates and accelerations of one frame, in order of preference.
struct Candidates {
  std::optional<Eigen::Vector3d> uncompensated, compensated, from_delta;
  [[nodiscard]] std::optional<Eigen::Vector3d> best() const {
    if (uncompensated) return uncompensated;
    return compensated ? compensated : from_delta;
  }
};

}  // namespace

FrameCheck VectorNav::check(std::span<const std::uint8_t> bytes) {
  if (bytes.empty() || bytes[0] != kSync) return {};
  if (bytes.size() < kMaskAt) return {FrameVerdict::kIncomplete, 0};
  const unsigned groups = bytes[1];
  if (groups == 0 || (groups >> kGroups) != 0) return {};
  std::size_t mask_at = kMaskAt;
  std::size_t payload = 0;
  for (std::size_t group = 0; group < kGroups; ++group) {
    if (((groups >> group) & 1U) == 0) continue;
    if (bytes.size() < mask_at + 2) return {FrameVerdict::kIncomplete, 0};
    const unsigned mask = LittleFieldReader(bytes.subspan(mask_at, 2)).u16();
    if (mask == 0) return {};
    for (std::size_t bit = 0; bit < kFields; ++bit) {
      if (((mask >> bit) & 1U) == 0) continue;
      if (kSizes[group][bit] == 0) return {};
      payload += kSizes[group][bit];
    }
    mask_at += 2;
  }
  const std::size_t length = mask_at + payload + kCrc;
  if (bytes.size() < length) return {FrameVerdict::kIncomplete, 0};
  // The CRC is sent most significant byte first, so the CRC including it is zero.
  const bool right = crc16Ccitt(0, bytes.subspan(1, length - 1)) == 0;
  return {right ? FrameVerdict::kWhole : FrameVerdict::kBadChecksum, length};
}

void VectorNav::read(std::span<const std::uint8_t> frame, InertialFrame& content) {
  const unsigned groups = frame[1];
  LittleFieldReader masks(frame.subspan(kMaskAt));
  std::array<unsigned, kGroups> mask = {};
  std::size_t payload_at = kMaskAt;
  for (std::size_t group = 0; group < kGroups; ++group) {
    if (((groups >> group) & 1U) == 0) continue;
    mask[group] = masks.u16();
    payload_at += 2;
  }

  Candidates gyro, accel;
  std::optional<std::uint64_t> startup, since_sync;
  std::optional<std::uint32_t> sync_count;
  std::optional<double> delta_time;
  LittleFieldReader from(frame.subspan(payload_at));
  for (std::size_t at = 0; at < kGroups * kFields; ++at) {
    if (((mask[at / kFields] >> (at % kFields)) & 1U) == 0) continue;
    switch (at) {
      case field(kCommon, 0):
      case field(kTime, 0):
        startup = from.u64();
        break;
      case field(kCommon, 2):
      case field(kTime, 4):
        since_sync = from.u64();
        break;
      case field(kCommon, 13):
      case field(kTime, 7):
        sync_count = from.u32();
        break;
      case field(kCommon, 5):
      case field(kImu, 10):
        gyro.compensated = from.vectorF32();
        break;
      case field(kCommon, 8):
      case field(kImu, 9):
        accel.compensated = from.vectorF32();
        break;
      case field(kCommon, 9):
        accel.uncompensated = from.vectorF32();
        gyro.uncompensated = from.vectorF32();
        break;
      case field(kImu, 2):
        accel.uncompensated = from.vectorF32();
        break;
      case field(kImu, 3):
        gyro.uncompensated = from.vectorF32();
        break;
      case field(kCommon, 11):
        delta_time = from.f32();
        gyro.from_delta = from.vectorF32() * kRadiansPerDegree / *delta_time;
        accel.from_delta = from.vectorF32() / *delta_time;
        break;
      case field(kImu, 6):
        delta_time = from.f32();
        gyro.from_delta = from.vectorF32() * kRadiansPerDegree / *delta_time;
        break;
      case field(kImu, 7):
        // The interval is part of DeltaTheta; without it, delta velocity cannot be used.
        if (delta_time)
          accel.from_delta = from.vectorF32() / *delta_time;
        else
          from.skip(kSizes[kImu][7]);
        break;
      default:
        from.skip(kSizes[at / kFields][at % kFields]);
    }
  }

  content.gyro = gyro.best();
  content.accel = accel.best();
  if (startup) {
    content.device = stampOf(*startup, 1);
    content.in_range = content.device.has_value();
  }
  if (!sync_count) return;
  const bool is_new = *sync_count != sync_count_ && *sync_count != 0;
  sync_count_ = *sync_count;
  if (!is_new || !startup || !since_sync || *since_sync > *startup || !content.device) return;
  TriggerEdge edge;
  edge.device = Stamp{static_cast<std::int64_t>(*startup - *since_sync)};
  edge.counter = sync_counter_.unwrap(*sync_count);
  (void)content.edges.tryPushBack(edge);
}

std::size_t encodeVectorNav(const ImuReading& reading, std::span<std::uint8_t> out) {
  constexpr std::uint8_t kCommonOnly = 1U << kCommon;
  constexpr std::uint16_t kTimeStartupAndImu = 0x0201;
  LittleFieldWriter to(out);
  to.u8(kSync);
  to.u8(kCommonOnly);
  to.u16(kTimeStartupAndImu);
  to.i64(reading.device.value_or(reading.arrival).ns);
  to.vectorF32(reading.accel);
  to.vectorF32(reading.gyro);
  if (!to.ok()) return 0;
  const std::uint16_t crc = crc16Ccitt(0, to.written().subspan(1));
  to.u8(static_cast<std::uint8_t>(crc >> 8U));
  to.u8(static_cast<std::uint8_t>(crc & 0xFFU));
  return to.ok() ? to.written().size() : 0;
}

}  // namespace swiftlet
