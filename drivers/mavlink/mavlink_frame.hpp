#pragma once
// Reads MAVLink frames of versions 1 and 2 from bytes, and writes version 2.
//
// The checksum covers the header, the payload as sent, and one byte that identifies the message's layout
// (CRC_EXTRA), so a receiver must know the message to verify it. Layout and rules: docs/mavlink.md. Memory:
// only the objects. Cost: O(length). Source: MAVLink guide, "Packet Serialization" and "Message Signing"; ids
// and layouts from common.xml.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/device/frame_buffer.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

constexpr std::size_t kLongestMavlinkPayload = 255;
/// Header 10, payload, checksum 2, signature 13.
constexpr std::size_t kLongestMavlinkFrame = 10 + kLongestMavlinkPayload + 2 + 13;

struct MavlinkFrame {
  Stamp arrival;  ///< of the first byte
  std::uint32_t message = 0;
  std::uint8_t version = 2;
  std::uint8_t sequence = 0;
  std::uint8_t system = 0;
  std::uint8_t component = 0;
  bool is_signed = false;   ///< has a signature of 13 bytes, which is not verified
  std::uint8_t length = 0;  ///< of the payload as sent, without trailing zeros
  std::array<std::uint8_t, kLongestMavlinkPayload> payload = {};  ///< zeros from `length` on
};

/// Content of a header; empty if no frame can start with these bytes.
struct MavlinkHeader {
  enum class Verdict : std::uint8_t { kNotHere, kIncomplete, kUnknownFlags, kRead };
  Verdict verdict = Verdict::kNotHere;
  std::uint32_t message = 0;
  std::size_t payload_begin = 0;
  std::size_t payload_length = 0;
  std::size_t frame_length = 0;  ///< including checksum and signature
};
MavlinkHeader readMavlinkHeader(std::span<const std::uint8_t> bytes);

/// The messages of common.xml used in this project.
struct KnownMessage {
  std::uint32_t id;
  std::uint8_t crc_extra;
  std::uint8_t shortest_v1;  ///< payload without extensions; version 1 does not trim
  std::uint8_t longest_v1;   ///< payload with extensions; some senders add them to version 1 too
};
std::optional<KnownMessage> knownMessage(std::uint32_t id);
std::optional<std::uint8_t> knownCrcExtra(std::uint32_t id);

/// The checksum of a complete frame, without and with its CRC_EXTRA.
std::uint16_t mavlinkChecksum(std::span<const std::uint8_t> frame, const MavlinkHeader& header);
std::uint16_t mavlinkChecksum(std::span<const std::uint8_t> frame, const MavlinkHeader& header,
                              std::uint8_t crc_extra);
/// The checksum in the frame.
std::uint16_t carriedChecksum(std::span<const std::uint8_t> frame, const MavlinkHeader& header);

/// Unpacks a complete frame with a valid checksum.
void unpackMavlink(const StampedFrame& bytes, MavlinkFrame& frame);

/// Our identity on a link. The sequence number increases with every frame written.
struct MavlinkSender {
  std::uint8_t system = 1;
  std::uint8_t component = 197;  ///< MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
  std::uint8_t sequence = 0;
};

/// Writes a version 2 frame without signature; `payload` has full length, trailing zeros are trimmed here.
/// Returns the frame's length; 0, with nothing written and the sequence unchanged, if `out` is too short.
std::size_t packMavlink(MavlinkSender& sender, std::uint32_t message, std::uint8_t crc_extra,
                        std::span<const std::uint8_t> payload, std::span<std::uint8_t> out);

}  // namespace swiftlet
