#pragma once
// Requested settings of a V4L2 camera.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct CameraDeviceSettings {
  std::array<char, 128> path = {};  ///< "/dev/video0"; better a name that stays, from /dev/v4l/by-path
  std::array<char, 5> format = {};  ///< four letters; empty: the first of kPixelFormats with size and rate
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

}  // namespace swiftlet
