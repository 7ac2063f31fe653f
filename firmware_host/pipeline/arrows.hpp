#pragma once
// What goes from thread to thread, and in what: the messages of wiring.cpp's arrows with the times that the
// host notes on them. Capacities: estimator/core/limits.hpp.

#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/drop_oldest_ring.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/newest.hpp"
#include "estimator/core/slot_pool.hpp"
#include "estimator/core/spsc_ring.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/keyframe_link.hpp"
#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "estimator/messages/scene_images.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "estimator/messages/state_fix.hpp"
#include "estimator/messages/step_record.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "firmware_host/pipeline/stage_timer.hpp"
#include "mapping/loop/loop_report.hpp"
#include "mapping/map/volume_correction.hpp"

namespace swiftlet {

/// Times of the host's monotonic clock [s].
struct HostTimes {
  double exposure = 0;  ///< middle of the exposure (IMU: the sample's stamp)
  double arrival = 0;   ///< handed to the estimator
};

struct ImuArrival {
  ImuSample sample;
  std::uint64_t number = 0;  ///< from 1
  Stamp arrival;             ///< on the log's clock
  HostTimes host;
};

/// Writes an image's pixels, grey, 8 bit, rows without padding, to where it is told: once, from the device's
/// memory into a slot.
struct PixelWriter {
  void (*write)(const void* device, std::uint8_t* pixels) = nullptr;
  const void* device = nullptr;
};

/// An image in its slot; `frame.image` shows `pixels`.
struct ImageSlot {
  CameraFrame frame;
  HostTimes host;
  std::vector<std::uint8_t> pixels;  ///< reserved for the camera's size before the flight
};

/// Readers of images, each with its quota.
enum ImageReader : std::size_t { kTrackReads, kMeshReads, kRecordReads, kImageReaders };

/// Waiting in the ring, one at its head, one waiting for its partner, those of waiting frames, those in
/// work, and one more that lets the newest in before the oldest goes.
inline constexpr std::uint32_t kTrackQuota = kImageRing + kWaitingFrames + 4;
/// Waiting in the ring, the one at its head, and one more that lets the newest in before the oldest goes.
inline constexpr std::uint32_t kMeshQuota = kMeshImages + 2;
inline constexpr std::uint32_t kRecordQuota = kRecordedImages;
inline constexpr std::size_t kImageSlots = 1 + kTrackQuota + kMeshQuota + kRecordQuota;
using ImagePool = SlotPool<ImageSlot, kImageSlots, kImageReaders>;

/// Images of a keyframe, copied by `track`: the threads that look at keyframes are slow, and would otherwise
/// hold the cameras' slots. `image` shows `pixels`; empty where missing.
struct KeyframeImages {
  std::uint64_t frame = 0;  ///< StereoFrame::index
  std::array<std::uint64_t, kMaxCameras> number{};
  std::array<ImageView, kMaxCameras> image;
  std::array<std::vector<std::uint8_t>, kMaxCameras> pixels;
};

enum KeyframeReader : std::size_t { kLoopReads, kMapReads, kKeyframeReaders };

/// Frames that wait for the map: as kLoopKeyframes.
inline constexpr std::size_t kMapFrames = 4;
/// As kMeshQuota.
inline constexpr std::uint32_t kLoopQuota = kLoopKeyframes + 2;
inline constexpr std::uint32_t kMapQuota = kMapFrames + 2;
using KeyframePool = SlotPool<KeyframeImages, 1 + kLoopQuota + kMapQuota, kKeyframeReaders>;

/// Depth and labels in their slot; `images` shows `depth` and `labels`.
struct SceneSlot {
  SceneImages images;
  std::vector<float> depth;
  std::vector<std::uint8_t> labels;
};
using ScenePool = SlotPool<SceneSlot, 1 + kMapQuota, 1>;

/// What came with a stamp, for `track`, which copies the images of that frame for the map.
struct SceneNote {
  Stamp stamp;
  bool depth = false;
  bool labels = false;
};

/// Between `track` and `smooth`. In order: the end comes last.
struct TrackMessage {
  enum class Kind : std::uint8_t {
    kFrame,         ///< tracked
    kFrameRefused,  ///< `status` says why; `tracked` is not filled
    kImageRefused,  ///< by pairing
    kEnd,
  };
  Kind kind = Kind::kFrame;
  Status status;
  TrackStep step;
  TrackedFrame tracked;
  HostTimes host;        ///< of the later image
  Spent spent;           ///< by `track`
  int dropped = 0;       ///< frames that went by untracked since the message before
  int effort_level = 0;  ///< steps below full effort
  bool mapped = false;   ///< its images have gone to the map
};

/// What `smooth` publishes: for the log, and whoever else follows the estimate.
struct FrameResult {
  TrackMessage::Kind kind = TrackMessage::Kind::kFrame;
  Status track_status;
  Status status;  ///< of the smoother
  TrackStep track_step;
  SmoothStep step;
  TrackedFrame tracked;
  OdometryOutput output;
  HostTimes host;
  double published = 0;  ///< host time
  Spent spent;           ///< by `track` and `smooth` until it was published
  int dropped = 0;
  int track_level = 0;
  int smooth_level = 0;
};

/// From `smooth` to `mesh`: the window, and the frame that is its newest.
struct MeshMessage {
  SmoothedWindow window;
  TrackedFrame tracked;
  std::uint64_t image = 0;  ///< number of camera 0's image of that frame; 0: missing

  /// False while the start waits.
  [[nodiscard]] bool hasPose() const { return window.started && !window.poses.empty(); }
};

/// From `smooth` to `loop`: a keyframe as it stands once it has been smoothed.
struct KeyframeMessage {
  std::uint64_t window_number = 0;
  SmoothedWindow window;
  TrackedFrame tracked;
  KeyframeLink link;
  std::array<std::uint64_t, kMaxCameras> image{};  ///< numbers; 0: missing
};

/// From `smooth` to `map`: a frame that is to be mapped, and how the window stands with it.
struct MapMessage {
  std::uint64_t frame = 0;
  Stamp stamp;  ///< of the images
  std::uint32_t epoch = 0;
  FixedVector<WindowPose, kMaxStates> poses;  ///< its own last
};

/// From `mesh` to `log`, where the meshes of all frames are wanted.
struct MeshResult {
  bool keyframe = false;  ///< `horizon` is of this frame
  LocalMesh frame;
  LocalMesh horizon;
  FixedVector<Eigen::Vector2f, kMaxFeatures> hull;  ///< of the frame's features, raw pixels of camera 0
};

/// Brings the slot that a reader waits for to the head of what it has on loan: older ones go back, a newer
/// one stays for later. False where it is not there.
template <typename Pool, typename Ring, typename Key, typename KeyOf>
bool bringToHead(Pool& pool, std::size_t reader, Ring& ring, typename Pool::Loan& head, const Key& wanted,
                 KeyOf&& keyOf) {
  while (!head || keyOf(*head) < wanted) {
    head.reset();
    SlotHandle handle;
    if (!ring.tryPop(handle)) return false;
    head = pool.borrow(handle, reader);
  }
  return keyOf(*head) == wanted;
}

using ImuRing = SpscRing<ImuArrival, kImuRing>;
/// Hands samples not later than `until` to `taker`, in order; how many.
template <typename Taker>
std::uint64_t takeSamples(ImuRing& ring, Stamp until, Taker&& taker) {
  std::uint64_t taken = 0;
  for (const ImuArrival* arrival = ring.front(); arrival != nullptr && arrival->sample.stamp <= until;
       arrival = ring.front()) {
    taker(arrival->sample);
    ring.pop();
    ++taken;
  }
  return taken;
}

/// The same where no frame has come for long and samples must not fill the ring: half of it is more than any
/// frame will ask for.
template <typename Taker>
std::uint64_t takeSurplus(ImuRing& ring, Taker&& taker) {
  std::uint64_t taken = 0;
  for (; ring.size() > kImuRing / 2; ++taken) {
    taker(ring.front()->sample);
    ring.pop();
  }
  return taken;
}

using ImageRing = DropOldestRing<SlotHandle, kImageRing>;
using MeshImageRing = DropOldestRing<SlotHandle, kMeshImages>;
using MeshRing = SpscRing<MeshResult, kResultRing>;
using TrackRing = SpscRing<TrackMessage, kTrackedRing>;
using ResultRing = SpscRing<FrameResult, kResultRing>;
using StateRing = SpscRing<NavState, kStateRing>;

/// What leads to `loop` and from there.
struct LoopArrows {
  DropOldestRing<SlotHandle, kLoopKeyframes> images;
  SpscRing<KeyframeMessage, kLoopKeyframes> keyframes;
  SpscRing<LoopReport, kResultRing> reports;  ///< to `log`
  std::uint64_t images_dropped = 0;           ///< of `track`: keyframes whose images found no room
};

/// How the odometry's world lies in the map, now and at each keyframe of the newest epoch that is a node.
struct WorldsInMap {
  MapCorrection newest;
  FixedVector<WorldInMap, LoopLimits{}.nodes> keyframes;  ///< by frame
  FixedVector<std::uint32_t, kTiedEpochs> tied;           ///< earlier epochs of the same piece
};

/// What leads to `map`.
struct MapArrows {
  ScenePool scenes{ScenePool::Quotas{kMapQuota}};
  DropOldestRing<SlotHandle, kMapFrames> scene;   ///< of `sensor`
  SpscRing<SceneNote, 4 * kMapFrames> notes;      ///< of `sensor` to `track`
  DropOldestRing<SlotHandle, kMapFrames> images;  ///< of `track`
  SpscRing<MapMessage, 4 * kMapFrames> frames;    ///< of `smooth`
  Newest<WorldsInMap> correction;                 ///< of `loop`
  std::uint64_t images_dropped = 0;               ///< of `track`: frames whose images found no room
};

/// What the recorder takes beside images: it looks at them every few milliseconds.
struct RecorderArrows {
  ImuRing imu;
  std::array<SpscRing<SlotHandle, kRecordQuota>, kMaxCameras> image;
  SpscRing<PropagateStep, kStepRing> propagate;
  SpscRing<TrackStep, kStepRing> track;
  SpscRing<SmoothStep, kStepRing> smooth;
  SpscRing<MeshStep, kStepRing> mesh;
  SpscRing<LoopStep, kStepRing> loop;
};

}  // namespace swiftlet
