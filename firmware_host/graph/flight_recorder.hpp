#pragma once
// Writes what the node `record` hands over. Data is flushed to the kernel every kFlushSeconds and synced to
// disk every kSyncSeconds.
//
// Items that were lost before they reached the node are found by gaps in the numbers of samples and images,
// and written as loss records in their place. Disk errors are kept by the writer (status, statistics);
// nothing else handles them.

#include <array>
#include <atomic>
#include <string>

#include "drivers/recorded/recording_writer.hpp"
#include "firmware_host/graph/messages.hpp"

namespace swiftlet {

class FlightRecorder {
 public:
  static constexpr double kFlushSeconds = 0.05;
  static constexpr double kSyncSeconds = 0.4;  ///< together with the duration of one sync: less than a second

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
  /// Number of steps of each kind lost so far.
  void noteLost(const std::array<std::uint64_t, kStepKinds.size()>& lost);
  /// After each drain: flushes and syncs if it is time.
  void keepUp();
  /// After the last drain: notes losses at the end, from the total numbers of samples and images, and marks
  /// the end.
  void end(std::uint64_t imu_samples, const std::array<std::uint64_t, kMaxCameras>& images);

  /// Any thread. True: no disk error so far.
  [[nodiscard]] bool running() const { return running_.load(std::memory_order_relaxed); }
  [[nodiscard]] const RecordingStatistics& statistics() const { return writer_.statistics(); }
  /// The first disk error, or ok.
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
