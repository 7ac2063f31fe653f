#pragma once
// Writes what the node `record` hands it, and keeps its promises in time: with the kernel every
// kFlushSeconds, on the disk every kSyncSeconds.
//
// What never came to the node is a loss record in its place, known by the gap in the numbers of samples and
// images. Errors of the disk stay with the writer (status, statistics): nothing here could be done about
// them.

#include <array>
#include <atomic>
#include <string>

#include "drivers/recorded/recording_writer.hpp"
#include "firmware_host/graph/messages.hpp"

namespace swiftlet {

class FlightRecorder {
 public:
  static constexpr double kFlushSeconds = 0.05;
  static constexpr double kSyncSeconds = 0.4;  ///< and one sync's duration: below a second in all

  FlightRecorder(const std::string& folder, const RecordingHeader& header) : writer_(folder, header) {}

  void write(const ImuArrival& sample);
  void write(const CameraFrame& image);
  void write(const PropagateStep& step) { static_cast<void>(writer_.propagateStep(step)); }
  void write(const TrackStep& step) { static_cast<void>(writer_.trackStep(step)); }
  void write(const SmoothStep& step) { static_cast<void>(writer_.smoothStep(step)); }
  void write(const MeshStep& step) { static_cast<void>(writer_.meshStep(step)); }
  void write(const LoopStep& step) { static_cast<void>(writer_.loopStep(step)); }
  void write(const MapRecord& record) { static_cast<void>(writer_.mapStep(record.step, record.scene)); }

  static constexpr std::array kStepKinds{RecordKind::kPropagateStep, RecordKind::kTrackStep,
                                         RecordKind::kSmoothStep,    RecordKind::kMeshStep,
                                         RecordKind::kLoopStep,      RecordKind::kMapStep};
  /// Steps of each kind that were lost so far.
  void noteLost(const std::array<std::uint64_t, kStepKinds.size()>& lost);
  /// After each drain: flushes and syncs when it is time.
  void keepUp();
  /// After the last drain: notes losses at the tail, from how many there were, and marks the end.
  void end(std::uint64_t imu_samples, const std::array<std::uint64_t, kMaxCameras>& images);

  /// Any thread. No error of the disk so far.
  [[nodiscard]] bool running() const { return running_.load(std::memory_order_relaxed); }
  [[nodiscard]] const RecordingStatistics& statistics() const { return writer_.statistics(); }
  /// The first error of the disk, or ok.
  [[nodiscard]] Status status() const { return writer_.status(); }

 private:
  void noteGap(RecordKind kind, std::uint64_t number, std::uint64_t& expected);

  RecordingWriter writer_;
  std::atomic<bool> running_{true};
  std::uint64_t next_sample_ = 1;
  std::array<std::uint64_t, kMaxCameras> next_image_{1, 1};
  std::array<std::uint64_t, kStepKinds.size()> steps_lost_{};
  double flushed_ = 0;  // host time
  double synced_ = 0;
};

}  // namespace swiftlet
