#include "drivers/mavlink/mavlink_frame.hpp"

#include <algorithm>

#include "drivers/device/byte_fields.hpp"
#include "drivers/device/crc16.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kStart1 = 0xFE;
constexpr std::uint8_t kStart2 = 0xFD;
constexpr std::size_t kHeader1 = 6;
constexpr std::size_t kHeader2 = 10;
constexpr std::size_t kChecksum = 2;
constexpr std::size_t kSignature = 13;
constexpr std::uint8_t kSignedFlag = 0x01;
constexpr std::uint16_t kCrcStart = 0xFFFF;

constexpr std::array<KnownMessage, 15> kKnown = {{{0, 50, 9, 9},          // HEARTBEAT
                                                  {26, 170, 22, 24},      // SCALED_IMU
                                                  {27, 144, 26, 29},      // RAW_IMU
                                                  {76, 152, 33, 33},      // COMMAND_LONG
                                                  {77, 143, 3, 10},       // COMMAND_ACK
                                                  {102, 158, 32, 117},    // VISION_POSITION_ESTIMATE
                                                  {103, 208, 20, 57},     // VISION_SPEED_ESTIMATE
                                                  {105, 93, 62, 63},      // HIGHRES_IMU
                                                  {111, 34, 16, 18},      // TIMESYNC
                                                  {112, 174, 12, 12},     // CAMERA_TRIGGER
                                                  {116, 76, 22, 24},      // SCALED_IMU2
                                                  {129, 46, 22, 24},      // SCALED_IMU3
                                                  {253, 83, 51, 54},      // STATUSTEXT
                                                  {330, 23, 158, 167},    // OBSTACLE_DISTANCE
                                                  {331, 91, 230, 233}}};  // ODOMETRY

}  // namespace

MavlinkHeader readMavlinkHeader(std::span<const std::uint8_t> bytes) {
  MavlinkHeader header;
  if (bytes.empty() || (bytes[0] != kStart1 && bytes[0] != kStart2)) return header;
  header.verdict = MavlinkHeader::Verdict::kIncomplete;
  const bool first_version = bytes[0] == kStart1;
  // Flags are checked as soon as they are received: a stray start byte should not wait for a payload.
  if (!first_version && bytes.size() > 2 && (bytes[2] & ~kSignedFlag) != 0) {
    header.verdict = MavlinkHeader::Verdict::kUnknownFlags;
    return header;
  }
  header.payload_begin = first_version ? kHeader1 : kHeader2;
  if (bytes.size() < header.payload_begin) return header;
  header.verdict = MavlinkHeader::Verdict::kRead;
  header.payload_length = bytes[1];
  header.frame_length = header.payload_begin + header.payload_length + kChecksum;
  if (first_version) {
    header.message = bytes[5];
    // Version 1 does not trim payloads, so a wrong length is detected at once.
    const auto known = knownMessage(header.message);
    if (known && (bytes[1] < known->shortest_v1 || bytes[1] > known->longest_v1))
      header.verdict = MavlinkHeader::Verdict::kNotHere;
  } else {
    LittleFieldReader id(bytes.subspan(7, 3));
    header.message = id.u16();
    header.message |= static_cast<std::uint32_t>(id.u8()) << 16U;
    if ((bytes[2] & kSignedFlag) != 0) header.frame_length += kSignature;
  }
  return header;
}

std::optional<KnownMessage> knownMessage(std::uint32_t id) {
  for (const KnownMessage& known : kKnown) {
    if (known.id == id) return known;
  }
  return {};
}

std::optional<std::uint8_t> knownCrcExtra(std::uint32_t id) {
  const auto known = knownMessage(id);
  if (!known) return {};
  return known->crc_extra;
}

std::uint16_t mavlinkChecksum(std::span<const std::uint8_t> frame, const MavlinkHeader& header) {
  return crc16Mcrf4xx(kCrcStart, frame.subspan(1, header.payload_begin + header.payload_length - 1));
}

std::uint16_t mavlinkChecksum(std::span<const std::uint8_t> frame, const MavlinkHeader& header,
                              std::uint8_t crc_extra) {
  return crc16Mcrf4xx(mavlinkChecksum(frame, header), {&crc_extra, 1});
}

std::uint16_t carriedChecksum(std::span<const std::uint8_t> frame, const MavlinkHeader& header) {
  return LittleFieldReader(frame.subspan(header.payload_begin + header.payload_length, kChecksum)).u16();
}

void unpackMavlink(const StampedFrame& stamped, MavlinkFrame& frame) {
  const std::span<const std::uint8_t> bytes = stamped.bytes;
  const MavlinkHeader header = readMavlinkHeader(bytes);
  const bool first_version = bytes[0] == kStart1;
  // Sequence, system and component follow the length in version 1 and the two flag bytes in version 2.
  const std::size_t identity = first_version ? 2 : 4;
  frame.arrival = stamped.arrival;
  frame.message = header.message;
  frame.version = first_version ? 1 : 2;
  frame.sequence = bytes[identity];
  frame.system = bytes[identity + 1];
  frame.component = bytes[identity + 2];
  frame.is_signed = !first_version && (bytes[2] & kSignedFlag) != 0;
  frame.length = static_cast<std::uint8_t>(header.payload_length);
  frame.payload.fill(0);
  const auto payload = bytes.subspan(header.payload_begin, header.payload_length);
  std::copy(payload.begin(), payload.end(), frame.payload.begin());
}

std::size_t packMavlink(MavlinkSender& sender, std::uint32_t message, std::uint8_t crc_extra,
                        std::span<const std::uint8_t> payload, std::span<std::uint8_t> out) {
  if (payload.empty() || payload.size() > kLongestMavlinkPayload) return 0;
  std::size_t length = payload.size();
  // The first byte is sent even when it is zero.
  while (length > 1 && payload[length - 1] == 0) --length;
  LittleFieldWriter writer(out);
  writer.u8(kStart2);
  writer.u8(static_cast<std::uint8_t>(length));
  writer.u8(0);
  writer.u8(0);
  writer.u8(sender.sequence);
  writer.u8(sender.system);
  writer.u8(sender.component);
  writer.u16(static_cast<std::uint16_t>(message & 0xFFFFU));
  writer.u8(static_cast<std::uint8_t>(message >> 16U));
  writer.copy(payload.first(length));
  if (!writer.ok() || out.size() < kHeader2 + length + kChecksum) return 0;
  writer.u16(crc16Mcrf4xx(crc16Mcrf4xx(kCrcStart, writer.written().subspan(1)), {&crc_extra, 1}));
  ++sender.sequence;
  return writer.written().size();
}

}  // namespace swiftlet
