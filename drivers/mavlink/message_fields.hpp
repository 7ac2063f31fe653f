#pragma once
// Shared by the readers and writers of messages. Private to this folder.

#include <array>
#include <cstdint>
#include <span>

#include "drivers/device/byte_fields.hpp"
#include "drivers/mavlink/mavlink_frame.hpp"

namespace swiftlet::mavlink {

inline LittleFieldReader reader(const MavlinkFrame& frame) { return LittleFieldReader(frame.payload); }

/// Buffer for the longest payload; finish() writes the frame.
class Payload {
 public:
  std::size_t finish(MavlinkSender& sender, std::uint32_t message, std::span<std::uint8_t> out) {
    const auto crc_extra = knownCrcExtra(message);
    return crc_extra ? packMavlink(sender, message, *crc_extra, fields.written(), out) : 0;
  }

 private:
  std::array<std::uint8_t, kLongestMavlinkPayload> bytes_ = {};

 public:
  LittleFieldWriter fields{bytes_};
};

inline Eigen::Vector3f vector(LittleFieldReader& from) {
  const float x = from.f32(), y = from.f32(), z = from.f32();
  return {x, y, z};
}

inline void put(LittleFieldWriter& to, const Eigen::Vector3f& value) {
  for (int i = 0; i < 3; ++i) to.f32(value[i]);
}

}  // namespace swiftlet::mavlink
