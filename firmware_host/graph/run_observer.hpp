#pragma once
// What the node `log` does with what comes: what the run tells its listener, what it sums up, and what it
// keeps for full smoothing. Host side, of one thread. Memory: constant but for the lists that RunStatistics
// names.

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
  /// Before the first message: the flight is to be located in a kept map of so many nodes.
  void awaitLocation(std::size_t nodes) { statistics_.located.emplace().nodes = nodes; }
  [[nodiscard]] bool wantsImu() const { return keeper_ != nullptr; }

  void addImu(const ImuSample& sample) { keeper_->addImu(sample); }
  /// The samples to come are of another time line.
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

  /// After the run: the map that was made.
  void showMap(MapStage& map, std::span<const std::uint32_t> tied) { listener_.onMap(map, tied); }
  /// After the run: the loops that were found, for full smoothing.
  void keepLoops(LoopStage& loops);
  [[nodiscard]] const std::vector<MapLoop>& loops() const { return loops_; }
  /// After the run: the keyframes' poses in the pose graph of the loops; empty without loop closure.
  [[nodiscard]] const std::vector<MapPose>& nodes() const { return nodes_; }
  /// After the run: closes the file of keyframes, where one was kept.
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
  std::uint32_t timeline_ = 0;  ///< of the samples kept
  std::string waiting_for_;
  bool any_frame_ = false;
  Effort track_effort_;
  Effort smooth_effort_;
  RunStatistics statistics_;
  std::vector<MapLoop> loops_;
  std::vector<MapPose> nodes_;  ///< of the pose graph, at the end
};

}  // namespace swiftlet
