#include "drivers/serial/stream_fault.hpp"

#include <cinttypes>

namespace swiftlet {

DeviceFault streamFault(const StreamCounters& before, const StreamCounters& now) {
  if (now.samples > before.samples) return {};
  const std::uint64_t bytes = now.bytes - before.bytes;
  const std::uint64_t frames = now.frames - before.frames;
  if (bytes == 0) return deviceFault(DeviceFaultKind::kSilent, 0, "no byte");
  if (frames == 0) {
    return deviceFault(DeviceFaultKind::kGarbage, 0,
                       "%" PRIu64 " bytes and no frame among them, %" PRIu64 " wrong checksums", bytes,
                       now.checksum_failures - before.checksum_failures);
  }
  const std::uint64_t not_finite = now.not_finite - before.not_finite;
  if (not_finite > 0) {
    return deviceFault(DeviceFaultKind::kFailed, 0, "%" PRIu64 " readings with NaN, infinity or a wild clock",
                       not_finite);
  }
  return deviceFault(DeviceFaultKind::kUnsupported, 0,
                     "%" PRIu64 " frames, none with rates and accelerations together: configure its output",
                     frames);
}

}  // namespace swiftlet
