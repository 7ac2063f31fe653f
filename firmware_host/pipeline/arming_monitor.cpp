#include "firmware_host/pipeline/arming_monitor.hpp"

#include "firmware_host/pipeline/wiring.hpp"

namespace swiftlet {
namespace {

constexpr Duration kLookBack = Duration::fromMilliseconds(1000);

bool sameConditions(const ArmingVerdict& a, const ArmingVerdict& b) {
  if (a.missing.size() != b.missing.size()) return false;
  for (std::size_t i = 0; i < a.missing.size(); ++i) {
    if (a.missing[i].condition != b.missing[i].condition) return false;
  }
  return true;
}

}  // namespace

void ArmingMonitor::measureRate(const SensorFacts& sensors, ArmingFacts& facts) {
  if (sensors.samples == 0) return;  // no stamp to begin from
  const Mark now{sensors.newest_sample, sensors.samples, sensors.reversed_stamps};
  if (!newer_ || now.stamp - newer_->stamp > kLookBack) {
    older_ = newer_ ? newer_ : now;
    newer_ = now;
  }
  const double seconds = (now.stamp - older_->stamp).seconds();
  if (seconds > 0) facts.imu_rate = static_cast<double>(now.samples - older_->samples) / seconds;
  facts.reversed_stamps = now.reversed - older_->reversed;
}

bool ArmingMonitor::update(const FrameResult& result, const SensorFacts& sensors, bool recorder_running,
                           std::uint64_t recorder_lost, double now) {
  const Stamp stamp = result.track_step.stamp;
  ArmingFacts facts;
  facts.flight_threads = ground_.flight_threads;
  facts.threads_without_priority = ground_.threads_without_priority;
  facts.first_without_priority = ground_.first_without_priority.c_str();
  facts.memory_locked = ground_.memory_locked;
  facts.has_sample = sensors.samples > 0;
  facts.newest_sample = sensors.newest_sample;
  facts.imu_rate_expected = ground_.imu_rate;
  facts.cameras = ground_.cameras;
  measureRate(sensors, facts);
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    facts.has_image_of[c] = sensors.image_arrival[c] > 0;
    if (!facts.has_image_of[c]) continue;
    // On the log's clock, as the bounds are.
    facts.image_age[c] = Duration::fromSeconds((now - sensors.image_arrival[c]) * ground_.speed);
    if (!facts.has_image || sensors.newest_image[c] > facts.newest_image) {
      facts.newest_image = sensors.newest_image[c];
    }
    facts.has_image = true;
  }
  const bool good = result.output.has_state && result.output.state.health == Health::kGood;
  if (!good) good_since_.reset();
  if (good && !good_since_) good_since_ = stamp;
  if (!epoch_since_ || result.output.state.epoch != epoch_) epoch_since_ = stamp;
  epoch_ = result.output.state.epoch;
  facts.health_good = good;
  if (good_since_) facts.health_good_for = stamp - *good_since_;
  facts.epoch_steady_for = stamp - *epoch_since_;
  facts.recorder_wanted = ground_.recorder_wanted;
  facts.recorder_running = recorder_running;
  facts.recorder_lost = recorder_lost;
  facts.track_level = result.track_level;
  facts.smooth_level = result.smooth_level;
  const ArmingVerdict verdict = rule_.evaluate(facts);
  const bool changed = !any_ || !sameConditions(verdict, verdict_);
  any_ = true;
  verdict_ = verdict;
  if (verdict.ready() && !first_ready_) first_ready_ = stamp;
  return changed;
}

}  // namespace swiftlet
