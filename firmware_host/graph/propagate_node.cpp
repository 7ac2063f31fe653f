#include "firmware_host/graph/propagate_node.hpp"

#include "firmware_host/interfaces/run_listener.hpp"

namespace swiftlet {

PropagateNode::PropagateNode(GraphContext& context)
    : Node("propagate", Rank::kPropagate),
      context_(context),
      stage_(context.noise, context.settings.odometry) {}

bool PropagateNode::turn() {
  const bool ended = inputEnded();
  const ImuArrival* arrival = samples.next();
  if (arrival == nullptr) {
    takeFix();
    if (ended) finish();
    return false;
  }
  const double cpu = threadCpuSeconds();
  takeFix();
  propagate(*arrival, cpu);
  samples.drop();
  return true;
}

void PropagateNode::takeFix() {
  const std::uint64_t number = fix.refresh();
  if (number == fix_) return;
  fix_ = number;
  steps.send({samples.taken(), number});
  context_.count(StageId::kFix, measured([&] { stage_.take(fix.value()); }));
}

void PropagateNode::propagate(const ImuArrival& arrival, double cpu) {
  if (samples.begins(arrival)) stage_.restart(arrival.timeline, arrival.sample.stamp);
  const LiveOutlets& outlets = context_.options.outlets;
  const bool asked = health_wanted_.load(std::memory_order_relaxed);
  const bool wanted = states.connected() || !outlets.empty() || asked;
  const Status status = stage_.step(arrival.sample, wanted ? &state_ : nullptr);
  if (status.ok()) states_given_.add();
  if (status.ok() && wanted) {
    states.send(state_);
    health_.store(state_.health, std::memory_order_relaxed);
    if (asked) health_wanted_.store(false, std::memory_order_relaxed);
    if (!outlets.empty()) {
      const StateNews news(state_, arrival.sample.gyro - state_.bias_gyro);
      for (LiveOutlet* outlet : outlets) outlet->state.write(news);
    }
  }
  context_.count(StageId::kImu, {wallSeconds() - arrival.host.arrival, threadCpuSeconds() - cpu});
  if (!status.ok() && status.code != StatusCode::kNotReady) {
    ++refused_;
    faults_.add(status);
  }
}

void PropagateNode::report(RunStatistics& statistics) const {
  statistics.imu_refused = refused_;
  for (const auto& row : faults_.rows()) statistics.faults[row.text] += row.count;
}

}  // namespace swiftlet
