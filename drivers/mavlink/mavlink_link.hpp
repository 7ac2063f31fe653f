#pragma once
// State of a MAVLink receiver: CRC_EXTRA of unknown messages, and the sequence number of each sender.
// MavlinkParser combines it with a buffer for readers of messages.
//
// A frame of an unknown message cannot be verified at first, because its CRC_EXTRA is unknown. But at most
// one of the 256 values makes its checksum right. That value is stored, and from the second frame that needs
// the same value the message counts as a frame of unknown kind. So sequence gaps are correct on links with
// any dialect, and no byte is accepted without a checksum of 16 bits. The first frame of each such message
// counts as skipped bytes.
//
// Memory: fixed, under 1 kB without the buffer. Cost: O(1) per frame; 256 more CRC steps for unknown
// messages.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/device/frame_buffer.hpp"
#include "drivers/device/stream_counters.hpp"
#include "drivers/mavlink/mavlink_frame.hpp"

namespace swiftlet {

class MavlinkLink {
 public:
  /// Whether a frame starts here. Called by a FrameBuffer once per position and result.
  FrameCheck check(std::span<const std::uint8_t> bytes, StreamCounters& counters);
  /// Counts signatures and lost messages; call for each complete frame, in order.
  void count(const MavlinkFrame& frame, StreamCounters& counters);
  /// Forgets the senders' sequence numbers, for use after the link was lost.
  void forgetSenders() { source_count_ = 0; }

 private:
  struct Learned {
    std::uint32_t message = 0;
    std::uint8_t crc_extra = 0;
    bool used = false;
  };
  struct Source {
    std::uint8_t system = 0;
    std::uint8_t component = 0;
    std::uint8_t sequence = 0;
  };

  bool hasLearned(std::uint32_t message, std::uint8_t crc_extra);
  FrameVerdict checkUnknown(std::span<const std::uint8_t> frame, const MavlinkHeader& header);

  // An autopilot's default streams have about 40 messages.
  std::array<Learned, 64> learned_ = {};
  std::size_t next_learned_ = 0;
  // Autopilot, camera, gimbal, ground station and routed senders; further ones are not tracked.
  std::array<Source, 16> sources_ = {};
  std::size_t source_count_ = 0;
};

class MavlinkParser {
 public:
  static constexpr std::size_t kMostFed = FrameBuffer<kLongestMavlinkFrame>::kMostFed;

  /// See FrameBuffer::feed().
  [[nodiscard]] std::size_t feed(std::span<const std::uint8_t> bytes, Stamp read_at, Duration byte_time) {
    return buffer_.feed(bytes, read_at, byte_time, counters_);
  }
  /// The next frame with a valid checksum, of any message; false: more bytes are needed.
  bool next(MavlinkFrame& frame);
  /// After the link was lost: drops a partial frame and the senders' sequence numbers, keeps the counters.
  void restart();
  [[nodiscard]] const StreamCounters& counters() const { return counters_; }
  [[nodiscard]] std::size_t waiting() const { return buffer_.waiting(); }

 private:
  FrameBuffer<kLongestMavlinkFrame> buffer_;
  MavlinkLink link_;
  StreamCounters counters_;
};

}  // namespace swiftlet
