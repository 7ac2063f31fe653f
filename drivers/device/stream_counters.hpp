#pragma once
// What came through a byte stream since it was opened. Nothing is lost silently:
//   bytes  = framed_bytes + skipped_bytes + what still waits for the rest of its frame
//   frames = samples + unknown_kinds + without_sample + not_finite   (inertial decoders)

#include <cstdint>

namespace swiftlet {

struct StreamCounters {
  std::uint64_t bytes = 0;              ///< fed
  std::uint64_t framed_bytes = 0;       ///< in whole frames with the right checksum
  std::uint64_t skipped_bytes = 0;      ///< that began no frame
  std::uint64_t frames = 0;             ///< whole, with the right checksum
  std::uint64_t checksum_failures = 0;  ///< places that looked like a frame until its checksum
  std::uint64_t unknown_kinds = 0;      ///< frames of a kind or version that the decoder does not read
  std::uint64_t without_sample = 0;     ///< frames it reads that hold no complete reading for us
  std::uint64_t not_finite = 0;         ///< readings dropped: NaN, infinite, or a clock out of range
  std::uint64_t samples = 0;            ///< readings given
  std::uint64_t missing_samples = 0;    ///< readings that the device's counter or clock shows as lost
  std::uint64_t clock_steps = 0;        ///< the device's clock went back: it was started again
  std::uint64_t edges = 0;              ///< trigger edges given or waiting
  std::uint64_t events_refused = 0;     ///< edges and TIMESYNC messages that found their queue full
  std::uint64_t lost_messages = 0;      ///< MAVLink: gaps of the sequence numbers, over all sources
  std::uint64_t signed_messages = 0;    ///< MAVLink: signature passed over, not checked
  std::uint64_t unknown_flags = 0;      ///< MAVLink: headers with unknown incompatibility flags

  bool operator==(const StreamCounters&) const = default;
};

}  // namespace swiftlet
