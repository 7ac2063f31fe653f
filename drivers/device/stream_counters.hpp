#pragma once
// Counters of a byte stream since it was opened. All bytes and frames are accounted for:
//   bytes  = framed_bytes + skipped_bytes + bytes of a frame that is not yet complete
//   frames = samples + unknown_kinds + without_sample + not_finite   (inertial decoders)

#include <cstdint>

namespace swiftlet {

struct StreamCounters {
  std::uint64_t bytes = 0;              ///< fed
  std::uint64_t framed_bytes = 0;       ///< in complete frames with a correct checksum
  std::uint64_t skipped_bytes = 0;      ///< not part of any frame
  std::uint64_t frames = 0;             ///< complete, with a correct checksum
  std::uint64_t checksum_failures = 0;  ///< positions that looked like a frame but had a wrong checksum
  std::uint64_t unknown_kinds = 0;      ///< frames of a kind or version that the decoder does not know
  std::uint64_t without_sample = 0;     ///< known frames without a complete reading
  std::uint64_t not_finite = 0;         ///< readings dropped: NaN, infinity, or a clock out of range
  std::uint64_t samples = 0;            ///< readings returned
  std::uint64_t missing_samples = 0;    ///< readings lost according to the device's counter or clock
  std::uint64_t clock_steps = 0;        ///< restarts: the device's clock went back
  std::uint64_t edges = 0;              ///< trigger edges returned or waiting
  std::uint64_t events_refused = 0;     ///< edges and TIMESYNC messages dropped because their queue was full
  std::uint64_t lost_messages = 0;      ///< MAVLink: gaps in the sequence numbers, over all sources
  std::uint64_t signed_messages = 0;    ///< MAVLink: signed messages; the signature is not checked
  std::uint64_t unknown_flags = 0;      ///< MAVLink: headers with unknown incompatibility flags

  bool operator==(const StreamCounters&) const = default;
};

}  // namespace swiftlet
