#pragma once
// Pool of the cameras' images: a fixed number of slots, lent by handle. Each reader has a quota, so no reader
// can use up another's slots. Capacities: estimator/core/limits.hpp.

#include <cstddef>
#include <cstdint>
#include <memory>

#include "estimator/core/limits.hpp"
#include "estimator/core/slot_pool.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/odometry/pairing.hpp"
#include "firmware_host/interfaces/host_times.hpp"

namespace swiftlet {

/// An image in its slot; `frame.image` shows `pixels`.
struct ImageSlot {
  CameraFrame frame;
  HostTimes host;
  /// Reserved for the camera's size before the flight and not zeroed: a run in one thread uses few slots, and
  /// pages of unused slots stay untouched.
  std::unique_ptr<std::uint8_t[]> pixels;
};

/// Readers of images, each with its quota.
enum ImageReader : std::size_t { kTrackReads, kMeshReads, kRecordReads, kViewReads, kImageReaders };

/// Images in the ring, one at its head, those waiting for their partners, those of waiting frames, those
/// being processed, and one more so that the newest can enter before the oldest leaves.
inline constexpr std::uint32_t kTrackQuota = kImageRing + kWaitingFrames + kPairingFrames + 3;
/// Images in the ring, the one at its head, and one more so that the newest can enter before the oldest
/// leaves.
inline constexpr std::uint32_t kMeshQuota = kMeshImages + 2;
inline constexpr std::uint32_t kRecordQuota = kRecordedImages;
/// Used only while somebody views: 0.2 s at 30 Hz until the tracks arrive, and two being processed.
inline constexpr std::uint32_t kViewQuota = 8;
inline constexpr std::size_t kImageSlots = 1 + kTrackQuota + kMeshQuota + kRecordQuota + kViewQuota;
using ImagePool = SlotPool<ImageSlot, kImageSlots, kImageReaders>;

}  // namespace swiftlet
