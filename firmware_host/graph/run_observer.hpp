#pragma once
// What the node `log` does with its input: notifies the run's listener, sums up statistics, and keeps data
// for full smoothing. Host side, one thread. Memory: constant except for the lists in RunStatistics.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "firmware_host/graph/messages.hpp"
#include "firmware_host/interfaces/run_listener.hpp"
#include "firmware_host/smoothing/full_smoothing.hpp"
#include "firmware_host/smoothing/map_keeper.hpp"
#include "mapping/loop/loop_stage.hpp"

namespace swiftlet {

class RunObserver {
 public:
  explicit RunObserver(RunListener& listener) : listener_(listener) {}

  /// Before the first message: keep keyframes and IMU for full smoothing.
  void keepForMap(std::unique_ptr<MapKeeper> keeper) { keeper_ = std::move(keeper); }
  /// Before the first message: the flight is to be located in a kept map with `nodes` nodes.
  void awaitLocation(std::size_t nodes) { statistics_.located.emplace().nodes = nodes; }
  [[nodiscard]] bool wantsImu() const { return keeper_ != nullptr; }

  void addImu(const ImuSample& sample) { keeper_->addImu(sample); }
  /// The samples that follow belong to another time line.
  void restart(std::uint32_t timeline, Stamp first);
  void onImuState(const NavState& state) { listener_.onImuState(state); }
  void onResult(const FrameResult& result);
  void onMesh(const MeshResult& result) {
    listener_.onMesh(result.keyframe, result.frame, result.keyframe ? &result.horizon : nullptr,
                     {result.hull.data(), result.hull.size()});
  }
  void onLoop(const LoopReport& report);
  void onLocalMesh(const LocalMesh& mesh) { listener_.onLocalMesh(mesh); }
  /// A remark of the schedule or the supervisor, for events.log.
  void remark(Stamp stamp, const std::string& text) { listener_.onRemark(stamp, text); }

  /// After the run: passes the map to the listener.
  void showMap(MapStage& map, std::span<const std::uint32_t> tied) { listener_.onMap(map, tied); }
  /// After the run: keeps the loops for full smoothing.
  void keepLoops(LoopStage& loops);
  [[nodiscard]] const std::vector<MapLoop>& loops() const { return loops_; }
  /// After the run: poses of the keyframes in the pose graph; empty without loop closure.
  [[nodiscard]] const std::vector<MapPose>& nodes() const { return nodes_; }
  /// After the run: closes the keyframe file, if one was written.
  void finishKeeping() {
    if (keeper_) keeper_->finish();
  }

  [[nodiscard]] RunStatistics& statistics() { return statistics_; }

 private:
  void noteLocated(const LoopReport& report);
  void noteFrame(const FrameResult& result);
  void noteEvents(const OdometryOutput& output);
  void noteEffort(const char* stage, const FrameResult& result, const Effort& now, Effort& last);
  void noteHealth(Stamp stamp, const OdometryOutput& output);

  RunListener& listener_;
  std::unique_ptr<MapKeeper> keeper_;
  std::uint32_t timeline_ = 0;  ///< of the kept samples
  std::string waiting_for_;
  bool any_frame_ = false;
  Effort track_effort_;
  Effort smooth_effort_;
  RunStatistics statistics_;
  std::vector<MapLoop> loops_;
  std::vector<MapPose> nodes_;  ///< of the pose graph; filled at the end
};

}  // namespace swiftlet
