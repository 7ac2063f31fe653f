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

/// Called on the thread `log`, in the order of the stream.
class RunListener {
 public:
  RunListener() = default;
  RunListener(const RunListener&) = delete;
  RunListener& operator=(const RunListener&) = delete;
  virtual ~RunListener() = default;

  /// After each frame that was smoothed; `output` also holds events and keyframes that left the window.
  virtual void onFrame(const TrackedFrame& tracked, const OdometryOutput& output) = 0;
  /// The state propagated to an IMU sample, when there is one.
  virtual void onImuState(const NavState& state) = 0;
  /// The meshes of a frame, if GraphOptions request them; `horizon` is null between keyframes, `hull` is that
  /// of the frame's features in raw pixels of camera 0.
  virtual void onMesh(bool /*keyframe*/, const LocalMesh& /*frame*/, const LocalMesh* /*horizon*/,
                      std::span<const Eigen::Vector2f> /*hull*/) {}
  /// At the end: the newest mesh over the horizon, when there is one.
  virtual void onLocalMesh(const LocalMesh& /*mesh*/) {}
  /// After each keyframe that loop closure has looked at.
  virtual void onLoop(const LoopReport& /*report*/) {}
  /// At the end: places and graph, if there are any; no report follows.
  virtual void onPlaces(LoopStage& /*places*/) {}
  /// At the end: the map, when there is one; `tied`: earlier epochs that lie in it, by loop closure.
  virtual void onMap(MapStage& /*map*/, std::span<const std::uint32_t> /*tied*/) {}
  /// At the end: keyframes and events not reported before.
  virtual void onFinish(const OdometryOutput& output) = 0;
  /// A remark of the schedule or the supervisor, for events.log.
  virtual void onRemark(Stamp stamp, const std::string& text) = 0;
};

struct EventTotal {
  std::uint64_t count = 0;
  double value = 0;  ///< summed
};

struct HealthChange {
  Stamp stamp;
  Health health = Health::kInitializing;
  std::uint32_t epoch = 0;
};

/// What the mesh stage and the mesh over the horizon counted.
struct MeshStatistics {
  MeshCounters stage;
  HorizonCounters horizon;
  std::uint64_t skipped = 0;        ///< windows that a newer one overtook
  std::uint64_t without_image = 0;  ///< steps without grey values
};

/// What became of the frames that waited for labels from outside.
struct HeldFrameCounters {
  std::uint64_t labelled = 0;    ///< frames mapped with labels that came in time
  std::uint64_t late = 0;        ///< mapped without labels: they were late
  std::uint64_t no_room = 0;     ///< without: too many others waited behind it
  std::uint64_t nobody = 0;      ///< mapped without labels: no labeller was connected
  std::uint64_t longest_ms = 0;  ///< that a frame was held
};

/// Counters of the thread `map` besides its stage's.
struct MapThreadStatistics {
  std::uint64_t frames = 0;         ///< that were to be mapped
  std::uint64_t without_image = 0;  ///< of them, skipped: others came before they were looked at
  std::uint64_t without_scene = 0;  ///< of them, those whose depth or labels were gone
  std::uint64_t refused = 0;        ///< by the stage
  /// Where labels come after their images.
  std::optional<HeldFrameCounters> held;
};

/// What became of a flight in a kept map.
struct LocatedStatistics {
  std::size_t nodes = 0;  ///< of the kept map
  bool now = false;
  std::optional<Stamp> first;   ///< located
  std::uint64_t keyframes = 0;  ///< while located
  std::uint64_t taken_back = 0;
};

/// Counters of a run. Host side: the lists grow with the number of changes, not of frames.
struct RunStatistics {
  std::uint64_t imu_samples = 0;  ///< handed in
  std::uint64_t imu_refused = 0;
  std::uint64_t images = 0;  ///< handed to pairing
  std::uint64_t frames = 0;  ///< frames (pairs or singles) that reached the odometry
  std::uint64_t frames_refused = 0;
  std::uint64_t frames_dropped = 0;  ///< went by while tracking was behind
  std::uint64_t effort_changes = 0;  ///< of a stage, from one frame to the next
  std::uint64_t smooth_faults = 0;
  std::uint64_t keyframes = 0;
  std::uint64_t poses = 0;  ///< frames with a state
  std::uint64_t frames_since_first_pose = 0;
  std::optional<Stamp> first_image;
  std::optional<Stamp> last_image;
  std::optional<Stamp> first_pose;
  PairingCounters pairing;
  std::map<EventKind, EventTotal> events;
  std::optional<FullSmootherReport> map;        ///< figures of the full smoothing, when it ran
  std::optional<MeshStatistics> mesh;           ///< when the run meshed
  std::optional<LoopCounters> loop;             ///< when the run closed loops
  std::optional<LocatedStatistics> located;     ///< when it flew in a kept map
  std::optional<MapThreadStatistics> mapping;   ///< when the run mapped
  std::map<std::string, std::uint64_t> faults;  ///< statuses that were not ok, by their text
  std::map<std::string, std::uint64_t> losses;  ///< what did not fit an arrow between threads, by its name
  std::vector<HealthChange> health;
  RunVerdict verdict;
  StageTable times;
};

}  // namespace swiftlet
