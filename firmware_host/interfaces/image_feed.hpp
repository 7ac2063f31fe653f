#pragma once
// Images of a run and what was found in them, for one thread outside the graph that shows them.
//
// The cameras' threads lend the slots that hold their images, without a copy: up to kViewQuota of each
// camera, and 30 a second. `smooth` adds the tracks of these frames, `loop` the matches of each loop. All of
// this happens only while `wanted` is set; otherwise each thread only reads the flag. Threads: each camera's
// own thread calls hand(), the reader sets `wanted` and calls tryPop(); `sight` and `loop` as Newest. Memory:
// three of each value. The slots belong to the graph's pools and live as long as this object.

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/newest.hpp"
#include "estimator/core/spsc_ring.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/frontend/frontend.hpp"
#include "estimator/geometry/se3.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "firmware_host/interfaces/image_pool.hpp"

namespace swiftlet {

/// A frame after it was smoothed.
struct SightNews {
  Stamp stamp;
  std::uint64_t frame = 0;
  bool keyframe = false;
  std::array<std::uint64_t, kMaxCameras> image{};  ///< CameraFrame::number; 0: missing
  FixedVector<TrackedFeature, kMaxFeatures> features;
  LostSightings lost;
  bool has_pose = false;
  FixedVector<TrackId, kMaxLandmarks> landmarks;  ///< of the window, unordered; only if has_pose
  std::uint32_t epoch = 0;
  std::array<SE3, kMaxCameras> T_world_cam;  ///< only if has_pose
};

/// A selected loop of this flight, just found.
struct LoopNews {
  struct Match {
    Eigen::Vector2f now = Eigen::Vector2f::Zero();   ///< px of camera 0, in the keyframe
    Eigen::Vector2f then = Eigen::Vector2f::Zero();  ///< px of camera 0, in the older keyframe
  };
  static constexpr std::size_t kMost = 100;  ///< matches; further ones are omitted

  Stamp stamp;  ///< of the keyframe
  Stamp old_stamp;
  std::size_t inliers = 0;
  FixedVector<Match, kMost> matches;
};

/// Selects the first image of a fast camera in each period. Equal stamps give equal decisions.
class ShownInstants {
 public:
  static constexpr std::int64_t kPeriod = 33'333'333;  ///< ns: images of 30 Hz and slower pass

  bool take(Stamp stamp) {
    const std::int64_t period = stamp.ns / kPeriod;
    return std::exchange(last_, period) != period;
  }

 private:
  std::int64_t last_ = -1;
};

struct ImageFeed {
  using Ring = SpscRing<SlotHandle, kViewQuota>;

  /// For the camera's thread: lends the image that it holds.
  void hand(std::size_t camera, SlotHandle handle, Stamp stamp) {
    if (!wanted.load(std::memory_order_relaxed) || !instants[camera].take(stamp)) return;
    if (!pool[camera]->tryHand(handle, kViewReads)) return;
    if (!handles[camera].tryPush(handle)) pool[camera]->takeBack(handle, kViewReads);
  }
  /// For the reader. False: no image is waiting.
  bool tryPop(std::size_t camera, ImagePool::Loan& loan) {
    SlotHandle handle;
    if (!handles[camera].tryPop(handle)) return false;
    loan = pool[camera]->borrow(handle, kViewReads);
    return true;
  }

  std::atomic<bool> wanted{false};
  std::array<std::shared_ptr<ImagePool>, kMaxCameras> pool;  ///< set by the graph before the first image
  std::array<Ring, kMaxCameras> handles;
  std::array<ShownInstants, kMaxCameras> instants;  ///< each used by its camera's thread
  Newest<SightNews> sight;
  Newest<LoopNews> loop;
};

}  // namespace swiftlet
