#pragma once
// The cameras' images in the program: slots of a fixed pool, lent by handle with a quota for each reader, so
// that no reader can hold another's. Capacities: estimator/core/limits.hpp.

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
  /// Reserved for the camera's size before the flight, and not zeroed: a run in one thread uses few slots,
  /// and the pages of the others stay untouched.
  std::unique_ptr<std::uint8_t[]> pixels;
};

/// Readers of images, each with its quota.
enum ImageReader : std::size_t { kTrackReads, kMeshReads, kRecordReads, kViewReads, kImageReaders };

/// Waiting in the ring, one at its head, those waiting for their partners, those of waiting frames, those in
/// work, and one more that lets the newest in before the oldest goes.
inline constexpr std::uint32_t kTrackQuota = kImageRing + kWaitingFrames + kPairingFrames + 3;
/// Waiting in the ring, the one at its head, and one more that lets the newest in before the oldest goes.
inline constexpr std::uint32_t kMeshQuota = kMeshImages + 2;
inline constexpr std::uint32_t kRecordQuota = kRecordedImages;
/// While somebody looks: 0.2 s at 30 Hz until their tracks are there, and two in work.
inline constexpr std::uint32_t kViewQuota = 8;
inline constexpr std::size_t kImageSlots = 1 + kTrackQuota + kMeshQuota + kRecordQuota + kViewQuota;
using ImagePool = SlotPool<ImageSlot, kImageSlots, kImageReaders>;

}  // namespace swiftlet
