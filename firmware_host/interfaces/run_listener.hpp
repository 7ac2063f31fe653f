#pragma once
// Notifications of a run to its recorder, and the statistics it collects.

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/odometry/pairing.hpp"
#include "estimator/smoother/full_smoother.hpp"
#include "firmware_host/interfaces/run_verdict.hpp"
#include "firmware_host/realtime/stage_timer.hpp"
#include "mapping/loop/loop_report.hpp"
#include "mesher/mesh_stage.hpp"

namespace swiftlet {

class LoopStage;
class MapStage;

/// Called by the thread `log`, in the order of the stream.
class RunListener {
 public:
  RunListener() = default;
  RunListener(const RunListener&) = delete;
  RunListener& operator=(const RunListener&) = delete;
  virtual ~RunListener() = default;

  /// After each smoothed frame; `output` also holds events and keyframes that left the window.
  virtual void onFrame(const TrackedFrame& tracked, const OdometryOutput& output) = 0;
  /// The state propagated to an IMU sample, if there is one.
  virtual void onImuState(const NavState& state) = 0;
  /// The meshes of a frame, if GraphOptions request them. `horizon` is null between keyframes; `hull` is the
  /// hull of the frame's features in raw pixels of camera 0.
  virtual void onMesh(bool /*keyframe*/, const LocalMesh& /*frame*/, const LocalMesh* /*horizon*/,
                      std::span<const Eigen::Vector2f> /*hull*/) {}
  /// At the end: the newest mesh over the horizon, if there is one.
  virtual void onLocalMesh(const LocalMesh& /*mesh*/) {}
  /// After each keyframe that loop closure has processed.
  virtual void onLoop(const LoopReport& /*report*/) {}
  /// At the end: places and pose graph, if there are any. No report follows.
  virtual void onPlaces(LoopStage& /*places*/) {}
  /// At the end: the map, if there is one. `tied`: earlier epochs that loop closure has tied to this map.
  virtual void onMap(MapStage& /*map*/, std::span<const std::uint32_t> /*tied*/) {}
  /// At the end: keyframes and events not reported before.
  virtual void onFinish(const OdometryOutput& output) = 0;
  /// A remark of the schedule or the supervisor, for events.log.
  virtual void onRemark(Stamp stamp, const std::string& text) = 0;
};

struct EventTotal {
  std::uint64_t count = 0;
  double value = 0;  ///< sum
};

struct HealthChange {
  Stamp stamp;
  Health health = Health::kInitializing;
  std::uint32_t epoch = 0;
};

/// Counters of the mesh stage and of the mesh over the horizon.
struct MeshStatistics {
  MeshCounters stage;
  HorizonCounters horizon;
  std::uint64_t skipped = 0;        ///< windows skipped because a newer one was available
  std::uint64_t without_image = 0;  ///< steps without image intensities
};

/// Outcomes of frames that waited for labels from outside.
struct HeldFrameCounters {
  std::uint64_t labelled = 0;    ///< mapped with labels that arrived in time
  std::uint64_t late = 0;        ///< mapped without labels: they were late
  std::uint64_t no_room = 0;     ///< mapped without labels: too many frames waited behind
  std::uint64_t nobody = 0;      ///< mapped without labels: no labeller was connected
  std::uint64_t longest_ms = 0;  ///< longest time a frame was held
};

/// Counters of the thread `map`, besides those of its stage.
struct MapThreadStatistics {
  std::uint64_t frames = 0;         ///< frames to be mapped
  std::uint64_t without_image = 0;  ///< of these, skipped because their images were no longer available
  std::uint64_t without_scene = 0;  ///< of these, skipped: depth sensor in use, but its depth was gone
  std::uint64_t refused = 0;        ///< by the map stage
  /// Only if labels arrive after their images.
  std::optional<HeldFrameCounters> held;
};

/// Localization of a flight in a kept map.
struct LocatedStatistics {
  std::size_t nodes = 0;  ///< of the kept map
  bool now = false;
  std::optional<Stamp> first;   ///< first time located
  std::uint64_t keyframes = 0;  ///< keyframes while located
  std::uint64_t taken_back = 0;
};

/// Counters of a run, on the host. The lists grow with the number of changes, not of frames.
struct RunStatistics {
  std::uint64_t imu_samples = 0;  ///< handed to the graph
  std::uint64_t imu_refused = 0;
  std::uint64_t images = 0;  ///< handed to pairing
  std::uint64_t frames = 0;  ///< frames (pairs or singles) that reached the odometry
  std::uint64_t frames_refused = 0;
  std::uint64_t frames_dropped = 0;  ///< dropped because tracking was behind
  std::uint64_t effort_changes = 0;  ///< changes of a stage's effort from one frame to the next
  std::uint64_t smooth_faults = 0;
  std::uint64_t keyframes = 0;
  std::uint64_t poses = 0;  ///< frames with a state
  std::uint64_t frames_since_first_pose = 0;
  std::optional<Stamp> first_image;
  std::optional<Stamp> last_image;
  std::optional<Stamp> first_pose;
  PairingCounters pairing;
  std::map<EventKind, EventTotal> events;
  std::optional<FullSmootherReport> map;        ///< full smoothing, if it ran
  std::optional<MeshStatistics> mesh;           ///< if the run meshed
  std::optional<LoopCounters> loop;             ///< if the run closed loops
  std::optional<LocatedStatistics> located;     ///< if the run flew in a kept map
  std::optional<MapThreadStatistics> mapping;   ///< if the run mapped
  std::map<std::string, std::uint64_t> faults;  ///< statuses other than ok, by text
  std::map<std::string, std::uint64_t> losses;  ///< values lost at full arrows, by the arrow's counter
  std::vector<HealthChange> health;
  RunVerdict verdict;
  StageTable times;
};

}  // namespace swiftlet
