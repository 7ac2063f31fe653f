#pragma once
// Cuts a byte stream into frames. A protocol decides from the bytes at one position whether a frame starts
// there; this class holds the bytes, finds the next position after a rejection, and knows when each byte
// arrived.
//
// - Results depend only on the bytes, not on how reads divided them.
// - After a rejection the search continues one byte later, never after the rejected length: a stray sync byte
//   costs no frame.
// - The arrival of a byte is the time of the read minus the number of bytes after it times the time of one
//   byte on the wire; that time is 0 for links without a real baud rate (USB CDC).
//
// Memory: nine bytes for each byte of capacity, inside the object. Cost: O(1) per byte, plus the protocol's
// check at positions that look like a frame.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/device/stream_counters.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class FrameVerdict : std::uint8_t {
  kNotHere,      ///< no frame begins at the first byte
  kIncomplete,   ///< a frame may begin here, but more bytes are needed; not allowed once the longest frame
                 ///< would fit
  kBadChecksum,  ///< a frame seemed to begin here, but its checksum is wrong
  kWhole,        ///< a frame of `length` bytes begins here
};

struct FrameCheck {
  FrameVerdict verdict = FrameVerdict::kNotHere;
  std::size_t length = 0;  ///< of a complete frame
};

/// Valid until the next feed().
struct StampedFrame {
  std::span<const std::uint8_t> bytes;
  Stamp arrival;  ///< of the first byte, CLOCK_MONOTONIC
};

template <std::size_t kLongestFrame>
class FrameBuffer {
 public:
  /// Number of bytes that feed() always accepts after next() has returned false: more than the kernel buffer
  /// of a serial port.
  static constexpr std::size_t kMostFed = 4096;

  /// Accepts as many bytes from the front of `bytes` as fit and returns their number. After next() has
  /// returned false, at least kMostFed bytes fit.
  [[nodiscard]] std::size_t feed(std::span<const std::uint8_t> bytes, Stamp read_at, Duration byte_time,
                                 StreamCounters& counters) {
    if (bytes.size() > bytes_.size() - end_) moveToFront();
    const std::size_t count = std::min(bytes.size(), bytes_.size() - end_);
    std::copy_n(bytes.begin(), count, bytes_.begin() + static_cast<std::ptrdiff_t>(end_));
    for (std::size_t i = 0; i < count; ++i) {
      const auto behind = static_cast<std::int64_t>(bytes.size() - 1 - i);
      arrivals_[end_ + i] = read_at - Duration{behind * byte_time.ns};
    }
    end_ += count;
    counters.bytes += count;
    return count;
  }

  /// The next complete frame, if there is one. `check(std::span<const std::uint8_t>) -> FrameCheck` examines
  /// the bytes from one position on. Unless it is kIncomplete, its result must not change when more bytes
  /// arrive.
  template <typename Check>
  bool next(Check&& check, StampedFrame& frame, StreamCounters& counters) {
    while (begin_ < end_) {
      const FrameCheck found = check(std::span<const std::uint8_t>(bytes_).subspan(begin_, end_ - begin_));
      if (found.verdict == FrameVerdict::kIncomplete) return false;
      if (found.verdict == FrameVerdict::kWhole) {
        frame = {std::span<const std::uint8_t>(bytes_).subspan(begin_, found.length), arrivals_[begin_]};
        begin_ += found.length;
        ++counters.frames;
        counters.framed_bytes += found.length;
        return true;
      }
      if (found.verdict == FrameVerdict::kBadChecksum) ++counters.checksum_failures;
      ++counters.skipped_bytes;
      ++begin_;
    }
    return false;
  }

  /// Bytes of a frame that is not yet complete.
  [[nodiscard]] std::size_t waiting() const { return end_ - begin_; }
  /// Drops them, for instance after the device was unplugged; they count as skipped.
  void clear(StreamCounters& counters) {
    counters.skipped_bytes += waiting();
    begin_ = end_ = 0;
  }

 private:
  void moveToFront() {
    std::copy(bytes_.begin() + static_cast<std::ptrdiff_t>(begin_),
              bytes_.begin() + static_cast<std::ptrdiff_t>(end_), bytes_.begin());
    std::copy(arrivals_.begin() + static_cast<std::ptrdiff_t>(begin_),
              arrivals_.begin() + static_cast<std::ptrdiff_t>(end_), arrivals_.begin());
    end_ -= begin_;
    begin_ = 0;
  }

  std::array<std::uint8_t, kMostFed + kLongestFrame> bytes_ = {};
  std::array<Stamp, kMostFed + kLongestFrame> arrivals_ = {};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
};

}  // namespace swiftlet
