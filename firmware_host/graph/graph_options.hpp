#pragma once
// What a run requests from its graph in addition to the settings.

#include <functional>
#include <optional>
#include <span>

#include "estimator/camera/rig.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "firmware_host/graph/effort_source.hpp"
#include "firmware_host/interfaces/label_exchange.hpp"
#include "firmware_host/interfaces/live_outlet.hpp"
#include "firmware_host/realtime/stage_timer.hpp"
#include "firmware_host/settings/settings.hpp"
#include "mapping/loop/kept_graph.hpp"
#include "mapping/map/map_stage.hpp"
#include "mapping/place/vocabulary.hpp"

namespace swiftlet {

class FlightRecorder;
class RunObserver;

struct GraphOptions {
  bool imu_states = false;               ///< calls RunListener::onImuState
  bool meshes = false;                   ///< calls RunListener::onMesh
  FlightRecorder* recorder = nullptr;    ///< null: no recording
  EffortSource* track_effort = nullptr;  ///< null: always the settings' effort
  EffortSource* smooth_effort = nullptr;
  const DepthImageView* depth_sensor = nullptr;  ///< of the map; null: none, the cameras give depth
  std::optional<ConfusionModel> confusion;       ///< of the map's labels; empty: the settings' certainty
  BlockStorage* storage = nullptr;         ///< of the map; null: blocks that do not fit the volume are lost
  const Vocabulary* vocabulary = nullptr;  ///< for loop closure; null: the shipped one; outlives the graph
  const KeptGraph* kept_map = nullptr;     ///< for settings.loop.in_map; outlives the graph's constructor
  /// Puts the kept map's volume into the map's volume; `nodes`: poses of its nodes in the graph. Empty: there
  /// is no kept map.
  std::function<void(MapSubmaps&, std::span<const WorldInMap> nodes)> kept_volume;
  /// Longest time `track` waits after a frame's arrival for the samples up to its stamp, on the host's clock.
  /// 0: it does not wait; the caller feeds the samples first.
  Duration sample_patience{0};
  LiveOutlets outlets;  ///< each gets all newest values; they outlive the graph
  /// Exchange over which labels arrive after their images; the map holds frames for them. Null: it does not
  /// wait.
  LabelExchange* labels = nullptr;
  /// Called by `log` at each turn: passes the input's remarks to the observer. True: there were some.
  std::function<bool(RunObserver&)> remarks;
  /// Called within a stage's measured wall time with its CPU seconds. Tests use it to slow stages down.
  std::function<void(StageId, double)> drag;
};

/// Shared by all nodes of a graph, which it outlives. `rig`: the cameras in use.
struct GraphContext {
  Rig rig;
  ImuNoise noise;
  const Settings& settings;
  GraphOptions options;
  StageTable times;  ///< each row belongs to one node

  /// Runs a stage's work and records its time.
  template <typename Work>
  Spent timed(StageId stage, Work&& work) {
    if (!options.drag) return measured(work);
    return measured([&] {
      const double cpu = threadCpuSeconds();
      work();
      options.drag(stage, threadCpuSeconds() - cpu);
    });
  }
  void count(StageId stage, const Spent& spent, bool keyframe = false) {
    addTime(times, stage, spent, keyframe);
  }
};

}  // namespace swiftlet
