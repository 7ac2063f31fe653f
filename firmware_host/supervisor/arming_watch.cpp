#include "firmware_host/supervisor/arming_watch.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace swiftlet {
namespace {

constexpr Duration kLookBack = Duration::fromMilliseconds(1000);
/// Health counts as good only if a frame confirmed it within this time.
constexpr Duration kOldestFrame = Duration::fromMilliseconds(1000);

}  // namespace

void ArmingWatch::begin(const FlightGround& ground) {
  ground_ = ground;
  ArmingSettings settings;
  settings.sensor_offset = imageLimit(settings.sensor_offset, ground.camera_rate);
  settings.image_age = imageLimit(settings.image_age, ground.camera_rate);
  rule_ = ReadyToArm(settings);
}

void ArmingWatch::measureRate(const SensorNews& imu, std::uint64_t reversed, ArmingFacts& facts) {
  if (imu.messages == 0) return;  // no stamp to start from
  const Mark now{imu.newest, imu.messages, reversed};
  if (newer_ && now.stamp < newer_->stamp) newer_.reset();  // stamps went back permanently: measure anew
  if (!newer_ || now.stamp - newer_->stamp > kLookBack) {
    older_ = newer_ ? newer_ : now;
    newer_ = now;
  }
  const double seconds = (now.stamp - older_->stamp).seconds();
  if (seconds > 0) facts.imu_rate = static_cast<double>(now.samples - older_->samples) / seconds;
  facts.reversed_stamps = now.reversed - older_->reversed;
}

ArmingVerdict ArmingWatch::evaluate(const FlightFacts& flight, Health health,
                                    std::span<const Trouble> troubles, Stamp now) {
  // Ages are on the run's clock, like the bounds of the rule.
  const auto since = [&](Stamp host) {
    return Duration::fromSeconds((now - host).seconds() * ground_.speed);
  };
  ArmingFacts facts;
  facts.flight_threads = ground_.flight_threads;
  facts.threads_without_priority = ground_.threads_without_priority;
  facts.first_without_priority = ground_.first_without_priority.data();
  facts.memory_locked = ground_.memory_locked;
  facts.has_sample = flight.imu.messages > 0;
  facts.newest_sample = flight.imu.newest;
  if (facts.has_sample) facts.sample_age = since(flight.imu.arrival);
  facts.imu_rate_expected = ground_.imu_rate;
  facts.cameras = ground_.cameras;
  std::uint64_t reversed = flight.imu.reversed_stamps;
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    const SensorNews& camera = flight.camera[c];
    reversed += camera.reversed_stamps;
    facts.has_image_of[c] = camera.messages > 0;
    facts.off_trigger[c] = flight.off_trigger[c];
    if (!facts.has_image_of[c]) continue;
    facts.image_age[c] = since(camera.arrival);
    if (!facts.has_image || camera.newest > facts.newest_image) facts.newest_image = camera.newest;
    facts.has_image = true;
  }
  measureRate(flight.imu, reversed, facts);

  const EstimateNews& estimate = flight.estimate;
  if (estimate.frames != frames_) frame_at_ = now;
  frames_ = estimate.frames;
  const bool fresh = frames_ > 0 && since(frame_at_) <= imageLimit(kOldestFrame, ground_.camera_rate);
  const bool good = fresh && estimate.has_state && health == Health::kGood;
  if (!good) good_since_.reset();
  if (good && !good_since_) good_since_ = now;
  if (!epoch_since_ || estimate.epoch != epoch_) epoch_since_ = now;
  epoch_ = estimate.epoch;
  facts.health_good = good;
  if (good_since_) facts.health_good_for = since(*good_since_);
  facts.epoch_steady_for = since(*epoch_since_);

  if (ground_.vehicle_up) {
    const auto& up = estimate.world_up;
    const double cosine = std::inner_product(up.begin(), up.end(), ground_.vehicle_up->begin(), 0.0);
    facts.vehicle_tilt = std::acos(std::clamp(cosine, -1.0, 1.0));
  }
  // The mounting is judged only while health is good.
  const bool tilted = good && facts.vehicle_tilt > ArmingSettings{}.tilt;
  if (!tilted) tilted_since_.reset();
  if (tilted && !tilted_since_) tilted_since_ = now;
  if (tilted_since_) facts.tilted_for = since(*tilted_since_);

  facts.recorder_wanted = ground_.recorder_wanted;
  facts.recorder_running = flight.recorder_running;
  facts.recorder_lost = flight.recorder_lost;
  facts.track_level = estimate.track_level;
  facts.smooth_level = estimate.smooth_level;
  for (const Trouble& trouble : troubles) {
    if (!trouble.blocks_arming) continue;
    if (facts.members_unwell++ > 0) continue;
    facts.first_unwell = trouble.name();
    facts.first_unwell_is = conditionName(trouble.condition);
    facts.first_unwell_text = trouble.text.data();
  }
  return rule_.evaluate(facts);
}

}  // namespace swiftlet
