#pragma once
// DroneCAN transfers: frames to payloads and back, for one kind of message from any number of nodes.
//
// A frame's last byte, the tail, carries start (0x80), end (0x40), toggle (0x20) and a transfer id of 5 bits.
// A transfer of several frames starts with CRC-16/CCITT-FALSE over the type's signature and the payload.
// Rules: a start frame begins a new transfer; a repeated frame is ignored; any other frame out of sequence
// ends the transfer, as do 2 s of silence, a failed checksum and a change between classic and FD.
// Memory: 132 bytes of payload for each of 127 nodes, inside the object (22 KiB). O(frame) per frame. Source:
// DroneCAN specification 4.1 (CAN bus transport layer) and 4.4 (CAN FD).

#include <array>
#include <cstdint>
#include <span>

#include "drivers/can/can_frame.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// Kind of a broadcast message; `crc` is the checksum of its 8-byte signature, the initial value for the
/// payload.
struct DroneCanType {
  std::uint16_t id = 0;
  std::uint16_t crc = 0;
};

[[nodiscard]] DroneCanType dronecanType(std::uint16_t id, std::uint64_t signature);

struct DroneCanId {
  std::uint8_t priority = 0;  ///< 0 is the highest, 31 the lowest
  std::uint16_t type = 0;
  bool service = false;
  std::uint8_t node = 0;  ///< 1 to 127; 0: anonymous
};
[[nodiscard]] DroneCanId dronecanId(std::uint32_t can_id);

struct DroneCanTransfer {
  std::uint8_t node = 0;
  std::uint8_t transfer_id = 0;
  bool fd = false;
  Stamp arrival;  ///< of the first frame
  std::span<const std::uint8_t>
      payload;  ///< FD: with up to 15 zero bytes of padding; valid until the next take()
};

struct DroneCanCounters {
  std::uint64_t transfers = 0;
  std::uint64_t lost = 0;    ///< gaps in the transfer ids; 31 or 32 transfers lost in a row are not seen
  std::uint64_t broken = 0;  ///< frames missing or out of order
  std::uint64_t checksum = 0;
  std::uint64_t timeouts = 0;
  std::uint64_t too_long = 0;
  std::uint64_t repeated = 0;  ///< frames and transfers received twice
  std::uint64_t strays = 0;    ///< frames without a tail, or of a transfer whose start was not received
};

class DroneCanReassembler {
 public:
  /// Payload with checksum; a RawIMU with 36 covariance terms in padded FD frames needs 126.
  static constexpr std::size_t kMaxBytes = 132;

  explicit DroneCanReassembler(DroneCanType type) : type_(type) {}

  /// True: `transfer` is complete and its checksum is correct. Frames of other types are ignored.
  bool take(const CanFrame& frame, DroneCanTransfer& transfer);
  [[nodiscard]] const DroneCanCounters& counters() const { return counters_; }

 private:
  struct Node {
    std::array<std::uint8_t, kMaxBytes> bytes;
    std::size_t size = 0;
    Stamp begun;
    Stamp latest;
    bool heard = false;  // within the timeout: `tail` holds the newest transfer id
    bool collecting = false;
    bool fd = false;
    std::uint8_t tail = 0;       // of the last accepted frame
    std::uint8_t last_size = 0;  // its data bytes without the tail
    bool completed = false;      // `bytes` holds a complete transfer
  };

  bool begin(Node& node, const CanFrame& frame, std::uint8_t tail);
  bool follow(Node& node, const CanFrame& frame, std::uint8_t tail);
  bool finish(Node& node, std::size_t checksum_bytes);
  void countLost(const Node& node, std::uint8_t transfer_id);

  static constexpr std::size_t kNodes = 128;
  DroneCanType type_;
  DroneCanCounters counters_;
  std::array<Node, kNodes> nodes_{};
};

/// Frames of one transfer, of 8 bytes each, or up to 64 for FD. Enough for kMaxBytes in classic frames.
struct DroneCanFrames {
  std::array<CanFrame, 20> frames;
  std::size_t count = 0;
};
/// False: the payload does not fit. `transfer_id` is taken modulo 32.
bool encodeTransfer(const DroneCanType& type, std::uint8_t priority, std::uint8_t node, unsigned transfer_id,
                    bool fd, std::span<const std::uint8_t> payload, DroneCanFrames& out);

}  // namespace swiftlet
