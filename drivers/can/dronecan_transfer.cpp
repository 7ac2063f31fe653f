#include "drivers/can/dronecan_transfer.hpp"

#include <algorithm>
#include <cstring>

#include "drivers/device/crc16.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kStart = 0x80;
constexpr std::uint8_t kEnd = 0x40;
constexpr std::uint8_t kToggle = 0x20;
constexpr std::uint8_t kIdMask = 0x1f;
constexpr std::uint32_t kIds = 32;
constexpr std::size_t kChecksumBytes = 2;
constexpr Duration kTimeout = Duration::fromMilliseconds(2000);  // from the specification

}  // namespace

DroneCanType dronecanType(std::uint16_t id, std::uint64_t signature) {
  std::array<std::uint8_t, 8> bytes = {};
  for (unsigned i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(signature >> (8 * i));
  return {id, crc16Ccitt(0xffff, bytes)};
}

DroneCanId dronecanId(std::uint32_t can_id) {
  DroneCanId id;
  id.priority = static_cast<std::uint8_t>(can_id >> 24U & 0x1fU);
  id.service = (can_id & 0x80U) != 0;
  id.node = static_cast<std::uint8_t>(can_id & 0x7fU);
  // An anonymous message uses 14 bits of the type for a discriminator; a service's type has 8 bits.
  const std::uint32_t type = can_id >> 8U;
  id.type =
      static_cast<std::uint16_t>(id.service ? type >> 8U & 0xffU : type & (id.node == 0 ? 0x3U : 0xffffU));
  return id;
}

bool DroneCanReassembler::take(const CanFrame& frame, DroneCanTransfer& transfer) {
  if (!frame.extended) return false;
  const DroneCanId id = dronecanId(frame.id);
  if (id.service || id.node == 0 || id.type != type_.id) return false;
  if (frame.size == 0) {
    ++counters_.strays;
    return false;
  }
  Node& node = nodes_[id.node];
  const std::uint8_t tail = frame.data[frame.size - 1U];
  if (node.heard && frame.arrival - node.latest > kTimeout) {
    counters_.timeouts += node.collecting ? 1 : 0;
    node.collecting = false;
    // Transfer ids may have wrapped around several times.
    node.heard = false;
  }
  const bool complete = (tail & kStart) != 0 ? begin(node, frame, tail) : follow(node, frame, tail);
  if (!complete) return false;
  ++counters_.transfers;
  const std::size_t skip = (tail & kStart) != 0 ? 0 : kChecksumBytes;
  transfer.node = id.node;
  transfer.transfer_id = tail & kIdMask;
  transfer.fd = node.fd;
  transfer.arrival = node.begun;
  transfer.payload = {node.bytes.data() + skip, node.size - skip};
  return true;
}

void DroneCanReassembler::countLost(const Node& node, std::uint8_t transfer_id) {
  const std::uint32_t step = (transfer_id + kIds - (node.tail & kIdMask)) % kIds;
  if (node.heard && step > 1) counters_.lost += step - 1;
}

bool DroneCanReassembler::begin(Node& node, const CanFrame& frame, std::uint8_t tail) {
  const std::size_t size = frame.size - 1U;
  const bool whole = (tail & kEnd) != 0;
  // Same id and same bytes: the bus repeated a frame. The id alone is not enough, as it recurs after 32
  // transfers.
  const bool same = node.fd == frame.fd && node.tail == tail && node.last_size == size &&
                    std::memcmp(node.bytes.data(), frame.data.data(), size) == 0;
  if (same && (whole ? node.completed && node.size == size : node.collecting && node.size == size)) {
    ++counters_.repeated;
    node.latest = frame.arrival;
    return false;
  }
  if ((tail & kToggle) != 0 || (!whole && size <= kChecksumBytes)) {
    ++counters_.strays;
    return false;
  }
  if (node.collecting) ++counters_.broken;
  countLost(node, tail & kIdMask);
  node.size = size;
  std::copy_n(frame.data.begin(), size, node.bytes.begin());
  node.begun = frame.arrival;
  node.latest = frame.arrival;
  node.fd = frame.fd;
  node.tail = tail;
  node.last_size = static_cast<std::uint8_t>(size);
  node.collecting = !whole;
  node.completed = whole;
  node.heard = true;
  return whole;
}

bool DroneCanReassembler::follow(Node& node, const CanFrame& frame, std::uint8_t tail) {
  const std::size_t size = frame.size - 1U;
  if (!node.collecting) {
    // A repeated last frame of a complete transfer ends up here too.
    const bool again = node.completed && tail == node.tail && size == node.last_size &&
                       std::memcmp(node.bytes.data() + node.size - size, frame.data.data(), size) == 0;
    ++(again ? counters_.repeated : counters_.strays);
    return false;
  }
  const bool same_transfer = (tail & kIdMask) == (node.tail & kIdMask) && frame.fd == node.fd;
  const bool in_turn = (tail & kToggle) != (node.tail & kToggle);
  if (same_transfer && !in_turn && tail == node.tail && size == node.last_size &&
      std::memcmp(node.bytes.data() + node.size - size, frame.data.data(), size) == 0) {
    ++counters_.repeated;
    node.latest = frame.arrival;
    return false;
  }
  const bool fits = node.size + size <= kMaxBytes;
  if (!same_transfer || !in_turn || !fits) {
    ++(same_transfer && in_turn ? counters_.too_long : counters_.broken);
    node.collecting = false;
    node.completed = false;
    return false;
  }
  std::copy_n(frame.data.begin(), size, node.bytes.begin() + static_cast<std::ptrdiff_t>(node.size));
  node.size += size;
  node.latest = frame.arrival;
  node.tail = tail;
  node.last_size = static_cast<std::uint8_t>(size);
  return (tail & kEnd) != 0 && finish(node, kChecksumBytes);
}

bool DroneCanReassembler::finish(Node& node, std::size_t checksum_bytes) {
  node.collecting = false;
  const auto sent = static_cast<std::uint16_t>(node.bytes[0] | node.bytes[1] << 8U);
  node.completed =
      sent == crc16Ccitt(type_.crc, {node.bytes.data() + checksum_bytes, node.size - checksum_bytes});
  if (!node.completed) ++counters_.checksum;
  return node.completed;
}

bool encodeTransfer(const DroneCanType& type, std::uint8_t priority, std::uint8_t node, unsigned transfer_id,
                    bool fd, std::span<const std::uint8_t> payload, DroneCanFrames& out) {
  const std::size_t room = (fd ? CanFrame::kMaxBytes : CanFrame::kClassicBytes) - 1;
  const bool several = payload.size() > room;
  std::array<std::uint8_t, DroneCanReassembler::kMaxBytes> bytes = {};
  std::size_t size = payload.size() + (several ? kChecksumBytes : 0);
  // FD frames have only certain lengths; padding counts as payload.
  const std::size_t last = size % room;
  const std::size_t padding = fd && last != 0 ? fdFrameSize(last + 1) - last - 1 : 0;
  if (size + padding > bytes.size()) return false;
  std::copy(payload.begin(), payload.end(), bytes.begin() + (several ? kChecksumBytes : 0));
  size += padding;
  if (several) {
    const std::uint16_t crc = crc16Ccitt(type.crc, {bytes.data() + kChecksumBytes, size - kChecksumBytes});
    bytes[0] = static_cast<std::uint8_t>(crc);
    bytes[1] = static_cast<std::uint8_t>(crc >> 8U);
  }
  out.count = 0;
  for (std::size_t at = 0; at < size || out.count == 0; at += room) {
    CanFrame& frame = out.frames[out.count];
    const std::size_t part = std::min(room, size - at);
    frame = {};
    frame.id = static_cast<std::uint32_t>(priority & 0x1fU) << 24U |
               static_cast<std::uint32_t>(type.id) << 8U | (node & 0x7fU);
    frame.fd = fd;
    frame.fast_data = fd;
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), part, frame.data.begin());
    frame.data[part] =
        static_cast<std::uint8_t>((out.count == 0 ? kStart : 0) | (at + part == size ? kEnd : 0) |
                                  (out.count % 2 == 1 ? kToggle : 0) | transfer_id % kIds);
    frame.size = static_cast<std::uint8_t>(part + 1);
    ++out.count;
  }
  return true;
}

}  // namespace swiftlet
