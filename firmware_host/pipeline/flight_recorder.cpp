#include "firmware_host/pipeline/flight_recorder.hpp"

#include "firmware_host/pipeline/stage_timer.hpp"

namespace swiftlet {

// Errors of the disk stay with the writer (status, statistics): nothing here could be done about them.

void FlightRecorder::noteGap(RecordKind kind, std::uint64_t number, std::uint64_t& expected) {
  if (number > expected) static_cast<void>(writer_.loss(kind, number - expected));
  expected = number + 1;
}

void FlightRecorder::writeImage(std::size_t camera, RecorderArrows& arrows, ImagePool& pool) {
  const ImagePool::Loan image = pool.borrow(*arrows.image[camera].front(), kRecordReads);
  arrows.image[camera].pop();
  noteGap(imageKind(camera), image->frame.number, next_image_[camera]);
  static_cast<void>(writer_.image(image->frame));
}

/// The earliest arrival; of equal ones the sample, then camera 0. Samples are looked at first: what came
/// before a sample that is seen is seen too.
bool FlightRecorder::writeNext(RecorderArrows& arrows, const std::array<ImagePool*, kMaxCameras>& pools) {
  const ImuArrival* sample = arrows.imu.front();
  std::size_t earliest = kMaxCameras;
  Stamp arrival;
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    const SlotHandle* handle = arrows.image[c].front();
    if (handle == nullptr) continue;
    const Stamp at = pools[c]->slot(handle->slot).frame.arrival;
    if (earliest != kMaxCameras && at >= arrival) continue;
    earliest = c;
    arrival = at;
  }
  if (sample != nullptr && (earliest == kMaxCameras || sample->arrival <= arrival)) {
    noteGap(RecordKind::kImu, sample->number, next_sample_);
    static_cast<void>(writer_.imu(sample->sample, sample->arrival));
    arrows.imu.pop();
    return true;
  }
  if (earliest == kMaxCameras) return false;
  writeImage(earliest, arrows, *pools[earliest]);
  return true;
}

template <typename Ring, typename Write>
bool FlightRecorder::drainSteps(Ring& ring, RecordKind kind, std::uint64_t& lost, Write&& write) {
  bool any = false;
  while (const auto* step = ring.front()) {
    static_cast<void>(write(*step));
    ring.pop();
    any = true;
  }
  if (const std::uint64_t refused = ring.refused(); refused > lost) {
    static_cast<void>(writer_.loss(kind, refused - lost));
    lost = refused;
  }
  return any;
}

bool FlightRecorder::drain(RecorderArrows& arrows, const std::array<ImagePool*, kMaxCameras>& pools) {
  bool any = false;
  while (writeNext(arrows, pools)) any = true;
  any = drainSteps(arrows.propagate, RecordKind::kPropagateStep, steps_lost_[0],
                   [&](const PropagateStep& step) { return writer_.propagateStep(step); }) ||
        any;
  any = drainSteps(arrows.track, RecordKind::kTrackStep, steps_lost_[1],
                   [&](const TrackStep& step) { return writer_.trackStep(step); }) ||
        any;
  any = drainSteps(arrows.smooth, RecordKind::kSmoothStep, steps_lost_[2],
                   [&](const SmoothStep& step) { return writer_.smoothStep(step); }) ||
        any;
  any = drainSteps(arrows.mesh, RecordKind::kMeshStep, steps_lost_[3],
                   [&](const MeshStep& step) { return writer_.meshStep(step); }) ||
        any;
  any = drainSteps(arrows.loop, RecordKind::kLoopStep, steps_lost_[4],
                   [&](const LoopStep& step) { return writer_.loopStep(step); }) ||
        any;
  if (!writer_.status().ok()) running_.store(false, std::memory_order_relaxed);
  const double now = wallSeconds();
  if (now - synced_ > kSyncSeconds) {
    static_cast<void>(writer_.sync());
    synced_ = flushed_ = wallSeconds();
  } else if (now - flushed_ > kFlushSeconds) {
    static_cast<void>(writer_.flush());
    flushed_ = now;
  }
  return any;
}

void FlightRecorder::end(std::uint64_t imu_samples, const std::array<std::uint64_t, kMaxCameras>& images) {
  noteGap(RecordKind::kImu, imu_samples + 1, next_sample_);
  for (std::size_t c = 0; c < kMaxCameras; ++c) noteGap(imageKind(c), images[c] + 1, next_image_[c]);
  static_cast<void>(writer_.end());
}

}  // namespace swiftlet
