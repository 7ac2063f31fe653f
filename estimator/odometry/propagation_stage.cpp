#include "estimator/odometry/propagation_stage.hpp"

#include "estimator/odometry/health_monitor.hpp"

namespace swiftlet {

Status PropagationStage::step(const ImuSample& sample, NavState* state) {
  const SampleVerdict verdict = monitor_.check(sample);
  if (!verdict.status.ok()) return verdict.status;
  if (verdict.learned) propagator_.setNoise(monitor_.noise().times(fix_.imu));
  const Status status = propagator_.step(sample, state);
  if (status.ok() && state != nullptr) {
    state->epoch = fix_.state.epoch;
    state->health = HealthMonitor::aged(fix_.state.health, fix_.last_accepted, fix_.good_age, sample.stamp);
  }
  return status;
}

void PropagationStage::restart(std::uint32_t timeline, Stamp /*first*/) {
  timeline_ = timeline;
  monitor_.restart();
  propagator_.reset();
}

void PropagationStage::take(const StateFix& fix) {
  if (fix.timeline != timeline_) return;
  if (fix.state.epoch != fix_.state.epoch) propagator_.forgetState();
  fix_ = fix;
  propagator_.setNoise(monitor_.noise().times(fix.imu));
  // The status needs no check: the smoother's states are finite, and a gap is already in the covariance.
  if (fix.has_state) static_cast<void>(propagator_.setState(fix.state, fix.gyro));
}

}  // namespace swiftlet
