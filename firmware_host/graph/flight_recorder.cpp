#include "firmware_host/graph/flight_recorder.hpp"

#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {

void FlightRecorder::noteGap(RecordKind kind, std::uint64_t number, std::uint64_t& expected) {
  if (number > expected) static_cast<void>(writer_.loss(kind, number - expected));
  expected = number + 1;
}

void FlightRecorder::write(const ImuArrival& sample) {
  noteGap(RecordKind::kImu, sample.number, next_sample_);
  static_cast<void>(writer_.imu(sample.sample, sample.arrival));
}

void FlightRecorder::write(const CameraFrame& image) {
  noteGap(imageKind(image.camera), image.number, next_image_[image.camera]);
  static_cast<void>(writer_.image(image));
}

void FlightRecorder::noteLost(const std::array<std::uint64_t, kStepKinds.size()>& lost) {
  for (std::size_t i = 0; i < lost.size(); ++i) {
    if (lost[i] > steps_lost_[i]) static_cast<void>(writer_.loss(kStepKinds[i], lost[i] - steps_lost_[i]));
    steps_lost_[i] = lost[i];
  }
}

void FlightRecorder::keepUp() {
  if (!writer_.status().ok()) running_.store(false, std::memory_order_relaxed);
  const double now = wallSeconds();
  if (now - synced_ > kSyncSeconds) {
    static_cast<void>(writer_.sync());
    synced_ = flushed_ = wallSeconds();
  } else if (now - flushed_ > kFlushSeconds) {
    static_cast<void>(writer_.flush());
    flushed_ = now;
  }
}

void FlightRecorder::end(std::uint64_t imu_samples, const std::array<std::uint64_t, kMaxCameras>& images) {
  noteGap(RecordKind::kImu, imu_samples + 1, next_sample_);
  for (std::size_t c = 0; c < kMaxCameras; ++c) noteGap(imageKind(c), images[c] + 1, next_image_[c]);
  static_cast<void>(writer_.end());
}

}  // namespace swiftlet
