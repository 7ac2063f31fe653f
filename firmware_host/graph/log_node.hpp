#pragma once
// The node `log`: passes what the run finds to its listener (run_observer.hpp), and keeps keyframes and
// samples for full smoothing.
//
// When it falls behind: results, states and meshes are missing in the files, counted; the estimate is not
// affected.

#include "firmware_host/graph/graph_options.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/graph/node.hpp"
#include "firmware_host/graph/run_observer.hpp"
#include "firmware_host/graph/sample_in.hpp"

namespace swiftlet {

class LogNode final : public Node {
 public:
  LogNode(GraphContext& context, RunObserver& observer)
      : Node("log", Rank::kLow), context_(context), observer_(observer) {}

  QueueIn<FrameResult, kResultRing> results{*this, "results_to_log", Arrow::kWaits};
  QueueIn<NavState, kStateRing> states{*this, "states_to_log", Arrow::kWaits};
  QueueIn<MeshResult, kResultRing> meshes{*this, "meshes_to_log", Arrow::kWaits};
  QueueIn<LoopReport, kResultRing> loops{*this, "loops_to_log", Arrow::kWaits};
  SampleIn samples{*this, "imu_to_log", Arrow::kWaits};
  LatestIn<LocalMesh> mesh{*this, Arrow::kWaits};

  bool turn() override;

 private:
  GraphContext& context_;
  RunObserver& observer_;
};

}  // namespace swiftlet
