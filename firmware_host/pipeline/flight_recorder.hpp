#pragma once
// The thread `record`: moves what the arrows bring into the recording, in the order of arrival, and keeps its
// promises in time: with the kernel every kFlushSeconds, on the disk every kSyncSeconds.
//
// Nobody waits for it. What found its arrow full is a loss record in its place, known by the gap in the
// numbers of samples and images.

#include <array>
#include <atomic>
#include <string>

#include "drivers/recorded/recording_writer.hpp"
#include "firmware_host/pipeline/arrows.hpp"

namespace swiftlet {

class FlightRecorder {
 public:
  static constexpr double kFlushSeconds = 0.05;
  static constexpr double kSyncSeconds = 0.4;  ///< and one sync's duration: below a second in all

  FlightRecorder(const std::string& folder, const RecordingHeader& header) : writer_(folder, header) {}

  /// Takes what waits; false when there was nothing.
  bool drain(RecorderArrows& arrows, const std::array<ImagePool*, kMaxCameras>& pools);
  /// After the last drain: notes losses at the tail, from how many there were, and marks the end.
  void end(std::uint64_t imu_samples, const std::array<std::uint64_t, kMaxCameras>& images);

  /// Any thread. No error of the disk so far.
  [[nodiscard]] bool running() const { return running_.load(std::memory_order_relaxed); }
  [[nodiscard]] const RecordingStatistics& statistics() const { return writer_.statistics(); }
  /// The first error of the disk, or ok.
  [[nodiscard]] Status status() const { return writer_.status(); }

 private:
  bool writeNext(RecorderArrows& arrows, const std::array<ImagePool*, kMaxCameras>& pools);
  void writeImage(std::size_t camera, RecorderArrows& arrows, ImagePool& pool);
  void noteGap(RecordKind kind, std::uint64_t number, std::uint64_t& expected);
  template <typename Ring, typename Write>
  bool drainSteps(Ring& ring, RecordKind kind, std::uint64_t& lost, Write&& write);

  RecordingWriter writer_;
  std::atomic<bool> running_{true};
  std::uint64_t next_sample_ = 1;
  std::array<std::uint64_t, kMaxCameras> next_image_{1, 1};
  std::array<std::uint64_t, 5> steps_lost_{};
  double flushed_ = 0;  // host time
  double synced_ = 0;
};

}  // namespace swiftlet
