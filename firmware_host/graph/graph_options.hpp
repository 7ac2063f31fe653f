#pragma once
// What a run asks of its graph beside the settings.

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
  bool imu_states = false;               ///< ask for RunListener::onImuState
  bool meshes = false;                   ///< ask for RunListener::onMesh
  FlightRecorder* recorder = nullptr;    ///< null: nothing is recorded
  EffortSource* track_effort = nullptr;  ///< null: the settings' effort, always
  EffortSource* smooth_effort = nullptr;
  const DepthImageView* depth_sensor = nullptr;  ///< of the map; null: none, depth from the cameras
  std::optional<ConfusionModel> confusion;       ///< of the map's labels; empty: the settings' certainty
  BlockStorage* storage = nullptr;         ///< of the map; null: what its volume has no room for is lost
  const Vocabulary* vocabulary = nullptr;  ///< of loop closure; null: the shipped one; outlives the graph
  const KeptGraph* kept_map = nullptr;     ///< of settings.loop.in_map; outlives the graph's constructor
  /// Puts the kept map's volume into that of the map, by where the graph's nodes had it; empty: there is
  /// none.
  std::function<void(MapSubmaps&, std::span<const WorldInMap> nodes)> kept_volume;
  /// Longest wait of `track` after a frame's arrival for the samples up to its stamp, on the host's clock. 0:
  /// no wait, the caller feeds the samples first.
  Duration sample_patience{0};
  LiveOutlets outlets;  ///< each gets the newest of everything; they outlive the graph
  /// Over which labels come after their image; the map holds frames for them. Null: it does not wait.
  LabelExchange* labels = nullptr;
  /// Called by `log` each time: what the input has to say of itself, to the log. True: there was something.
  std::function<bool(RunObserver&)> remarks;
  /// Called after a stage's work with its CPU seconds, within its wall time: tests slow stages down.
  std::function<void(StageId, double)> drag;
};

/// What all nodes of a graph share. `rig`: the cameras in use. It outlives the nodes.
struct GraphContext {
  Rig rig;
  ImuNoise noise;
  const Settings& settings;
  GraphOptions options;
  StageTable times;  ///< each row is one node's

  /// Runs a stage's work and counts its time.
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
