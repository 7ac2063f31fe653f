#pragma once
// Requested settings of a V4L2 camera.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct CameraDeviceSettings {
  std::array<char, 128> path = {};  ///< "/dev/video0", or better a persistent name in /dev/v4l/by-path
  std::array<char, 5> format = {};  ///< four letters; empty: the first of kPixelFormats with size and rate
  int width = 0;                    ///< pixels; if two cameras share an image, of both halves
  int height = 0;
  double rate = 0;                   ///< frames per second; 0: unchanged
  bool triggered = false;            ///< an external trigger gives the rate: a faster mode serves as well
  std::optional<Duration> exposure;  ///< manual; empty: unchanged
  std::optional<std::int32_t> gain;  ///< manual, in the driver's own units; empty: unchanged
  std::uint32_t buffers = 6;         ///< 4 to VideoNode::kMaxBuffers
  bool require_monotonic = true;     ///< false: if the driver's clock is unknown, arrivals are used as stamps

  void setPath(const char* text);
  void setFormat(const char* text);
};

}  // namespace swiftlet
