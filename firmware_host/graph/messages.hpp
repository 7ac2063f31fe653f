#pragma once
// Messages between nodes, with the times that the host adds. Images: images.hpp.

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/status.hpp"
#include "estimator/frontend/frontend.hpp"
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
#include "firmware_host/interfaces/host_times.hpp"
#include "firmware_host/realtime/stage_timer.hpp"
#include "mapping/loop/loop_report.hpp"
#include "mapping/loop/loop_settings.hpp"
#include "mapping/map/submaps.hpp"

namespace swiftlet {

struct ImuArrival {
  ImuSample sample;
  std::uint64_t number = 0;    ///< from 1, including samples that the guard held out
  std::uint32_t timeline = 0;  ///< of its stamp (estimator/odometry/stamp_guard.hpp)
  Stamp arrival;               ///< on the log's clock
  HostTimes host;
};

/// Whether depth and labels came with a stamp. For `track`, which copies the images of that frame for the
/// map.
struct SceneNote {
  Stamp stamp;
  bool depth = false;
  bool labels = false;
};

/// From `track` to `smooth`.
struct TrackMessage {
  enum class Kind : std::uint8_t {
    kFrame,         ///< tracked
    kFrameRefused,  ///< `status` says why; `tracked` is not filled
    kImageRefused,  ///< refused by pairing
    kEnd,           ///< only in FrameResult: the last one of the run
  };
  Kind kind = Kind::kFrame;
  Status status;
  TrackStep step;
  TrackedFrame tracked;
  HostTimes host;        ///< of the image that arrived last
  double ready = 0;      ///< host time at which `track` had images and samples [s]
  Spent spent;           ///< used by `track`
  int dropped = 0;       ///< frames not tracked since the previous message
  int effort_level = 0;  ///< levels below full effort
  bool mapped = false;   ///< its images were sent to the map
  LostSightings lost;    ///< by the front-end; filled only while images are shown
};

/// Output of `smooth`, for the log and all readers of the estimate.
struct FrameResult {
  TrackMessage::Kind kind = TrackMessage::Kind::kFrame;
  Status track_status;
  Status status;  ///< status of the smoother
  TrackStep track_step;
  SmoothStep step;
  TrackedFrame tracked;
  OdometryOutput output;
  HostTimes host;
  double published = 0;  ///< host time
  Spent spent;           ///< used by `track` and `smooth` until publication
  int dropped = 0;
  int track_level = 0;
  int smooth_level = 0;
};

/// From `smooth` to `mesh`: the window, and the frame that is its newest.
struct MeshMessage {
  SmoothedWindow window;
  TrackedFrame tracked;
  std::uint64_t image = 0;  ///< number of camera 0's image of that frame; 0: missing

  /// False while the smoother initializes.
  [[nodiscard]] bool hasPose() const { return window.started && !window.poses.empty(); }
};

/// From `smooth` to `loop`: a keyframe after it was smoothed.
struct KeyframeMessage {
  std::uint64_t window_number = 0;
  SmoothedWindow window;
  TrackedFrame tracked;
  KeyframeLink link;
  std::array<std::uint64_t, kMaxCameras> image{};  ///< numbers; 0: missing
};

/// From `smooth` to `map`: a frame to be mapped.
struct MapMessage {
  std::uint64_t frame = 0;
  Stamp stamp;  ///< stamp of the images
  std::uint32_t epoch = 0;
  WindowPose pose;
};

/// From `mesh` to `log`, if the meshes of all frames are requested.
struct MeshResult {
  bool keyframe = false;  ///< `horizon` is of this frame
  LocalMesh frame;
  LocalMesh horizon;
  FixedVector<Eigen::Vector2f, kMaxFeatures> hull;  ///< of the frame's features, raw pixels of camera 0
};

/// Transforms from the odometry's world to the map, now and at listed keyframes (listWorlds()).
struct WorldsInMap {
  MapCorrection newest;
  /// Most listed nodes of a kept map; the map moves evenly between listed nodes.
  static constexpr std::size_t kMostKept = 1000;
  FixedVector<WorldInMap, LoopLimits{}.nodes + kMostKept> keyframes;  ///< ordered by frame
  FixedVector<std::uint32_t, kTiedEpochs> tied;                       ///< LoopStage::tiedEpochs()
};

/// From `map` to `record`: a step, with the depth and labels it used.
struct MapRecord {
  MapStep step;
  SceneImages scene;  ///< shows `depth` and `labels`
  std::vector<float> depth;
  std::vector<std::uint8_t> labels;
};

inline constexpr Stamp kEndOfTime{std::numeric_limits<std::int64_t>::max()};

}  // namespace swiftlet
