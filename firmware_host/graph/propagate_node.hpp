#pragma once
// The node `propagate`: a state for every IMU sample, propagated from the newest fix of `smooth`.
//
// When samples arrive faster than it works: none is skipped; a queue overflow is a counted fault.

#include <atomic>
#include <cstdint>

#include "estimator/messages/state_fix.hpp"
#include "estimator/odometry/propagation_stage.hpp"
#include "firmware_host/graph/graph_options.hpp"
#include "firmware_host/graph/node.hpp"
#include "firmware_host/graph/sample_in.hpp"
#include "firmware_host/interfaces/fault_counts.hpp"

namespace swiftlet {

class PropagateNode final : public Node {
 public:
  explicit PropagateNode(GraphContext& context);

  SampleIn samples{*this, "imu_to_propagate", Arrow::kWakes};
  LatestIn<StateFix> fix{*this, Arrow::kFeedback};
  Out<NavState> states{*this};  ///< every state, on request
  Out<PropagateStep> steps{*this};

  bool turn() override;
  /// Any thread: number of states so far.
  [[nodiscard]] std::uint64_t stateCount() const { return states_given_.value(); }
  /// One thread: health of the newest state at the previous call, or of a later state. If no reader receives
  /// the states, this call requests the next one.
  [[nodiscard]] Health askHealth() {
    health_wanted_.store(true, std::memory_order_relaxed);
    return health_.load(std::memory_order_relaxed);
  }
  void report(RunStatistics& statistics) const override;

 private:
  void takeFix();
  void propagate(const ImuArrival& arrival, double cpu);

  GraphContext& context_;
  PropagationStage stage_;
  NavState state_;
  std::uint64_t fix_ = 0;
  EventCount states_given_;
  std::atomic<Health> health_{Health::kInitializing};
  std::atomic<bool> health_wanted_{false};
  std::uint64_t refused_ = 0;
  FaultCounts faults_;
};

}  // namespace swiftlet
