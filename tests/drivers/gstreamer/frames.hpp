#pragma once
// Opens pipelines and takes their frames, for tests.

#include <poll.h>

#include <string>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/gstreamer/pipeline_source.hpp"

namespace swiftlet::test {

inline PipelineSettings pipeline(const std::string& text, int width, int height, double rate) {
  PipelineSettings settings;
  settings.text = text;
  settings.width = width;
  settings.height = height;
  settings.rate = rate;
  return settings;
}

/// The next frame as a thread waits for it; not valid: a fault, which `fault` gets, or none for 5 s.
inline CapturedFrame awaitFrame(PipelineSource& source, DeviceFault* fault = nullptr) {
  constexpr Duration kLimit = Duration::fromMilliseconds(5000);
  CapturedFrame frame;
  for (const Stamp end = monotonicNow() + kLimit; monotonicNow() < end;) {
    const DeviceFault said = source.next(frame);
    if (fault != nullptr) *fault = said;
    if (!said.ok() || frame.valid()) break;
    pollfd waiting{source.fd(), POLLIN, 0};
    poll(&waiting, 1, 100);
  }
  return frame;
}

}  // namespace swiftlet::test
