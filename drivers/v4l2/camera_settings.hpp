#pragma once
// What a camera is asked for, and what it made of it.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "drivers/v4l2/pixel_format.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct CameraDeviceSettings {
  std::array<char, 128> path = {};  ///< "/dev/video0"; better a name that stays, from /dev/v4l/by-path
  std::array<char, 5> format = {};  ///< four letters; empty: the first of kPixelFormats that is offered
  int width = 0;                    ///< pixels, of both halves where two cameras share an image
  int height = 0;
  double rate = 0;                   ///< frames a second; 0: as it is
  std::optional<Duration> exposure;  ///< manual; empty: as it is
  std::optional<std::int32_t> gain;  ///< the driver's own units, manual; empty: as it is
  std::uint32_t buffers = 6;         ///< 4 to VideoNode::kMaxBuffers
  bool require_monotonic = true;     ///< false: where the driver's clock is unknown, arrivals are stamps

  void setPath(const char* text);
  void setFormat(const char* text);
};

/// Which instant the driver's stamp marks.
enum class StampEvent : std::uint8_t {
  kStartOfExposure,
  kEndOfFrame,
  kArrival,  ///< the driver's clock is unknown: the host's time when the frame was taken from the queue
};

/// As negotiated and read back.
struct CameraFacts {
  std::array<char, 17> driver = {};
  std::array<char, 33> card = {};
  std::array<char, 33> bus = {};
  PixelFormat format = PixelFormat::kGrey;
  int width = 0;
  int height = 0;
  int stride = 0;                    ///< bytes
  double rate = 0;                   ///< frames a second; 0: the driver does not say
  std::optional<Duration> exposure;  ///< empty: it has no such control in units of time
  std::optional<std::int32_t> gain;
  StampEvent event = StampEvent::kEndOfFrame;
  std::size_t buffers = 0;
};

/// Since construction, over unplugging.
struct CameraCounters {
  std::uint64_t frames = 0;          ///< given out
  std::uint64_t missed = 0;          ///< holes in `sequence`: no buffer was free, or the driver dropped it
  std::uint64_t damaged = 0;         ///< flagged by the driver; put back unseen
  std::uint64_t too_short = 0;       ///< fewer bytes than the size; put back unseen
  std::uint64_t stamp_ahead = 0;     ///< stamps later than their arrival
  std::uint64_t requeue_failed = 0;  ///< buffers that could not be put back
  std::uint64_t reopened = 0;
};

}  // namespace swiftlet
