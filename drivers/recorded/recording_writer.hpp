#pragma once
// Writes a flight recording: everything that entered the estimator, in a form that survives a kill and a
// power cut. recording_source.hpp reads it; recording_format.hpp has the layout.
//
// Threads: one, the recorder's own. Not on the flight path; calls may block in the kernel.
// Memory: one buffer of RecordingOptions::buffer_bytes, touched at construction; no allocation afterwards.
//   Pixels of a large image go from the caller's memory to the kernel without a copy.
// Cost: one pass over the payload for the checksum, and the kernel's copy.
// Errors: InputError at construction (folder not writable, recording in use). Afterwards a Status: the first
//   disk error (full, I/O) ends writing permanently, later calls return it at once, and statistics().lost
//   counts the records of each kind that did not reach the file. What was written before stays valid: the
//   segment is cut after its last complete record.
//
// What survives:
//   after flush(): everything so far is in the kernel and survives a crash or kill -9 of the program.
//   after sync(): everything so far is on the disk and survives a power cut. An owner that flushes after each
//     drain of its rings and syncs every 0.5 s loses at most the last 0.5 s and the duration of one sync.
//   A full segment is synced when the next one begins.
//
// Segments: a new file every RecordingOptions::segment_bytes. Segments of an earlier run in the folder are
//   deleted first, other files are kept. During writing the folder is locked against other writers and
//   readers (flock; the kernel releases it however the program ends).

#include <sys/uio.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/recorded/recording_format.hpp"
#include "drivers/recorded/recording_header.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/frames.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/scene_images.hpp"
#include "estimator/messages/step_record.hpp"

namespace swiftlet {

struct RecordingOptions {
  std::size_t segment_bytes = 64U << 20U;  ///< a new segment starts before the record that would exceed this
  std::size_t buffer_bytes = 1U << 20U;    ///< at least 128 KiB is used
};

struct RecordingStatistics {
  std::uint64_t records = 0;   ///< complete in the file or the buffer
  std::uint64_t bytes = 0;     ///< of these and of the segments' headers
  std::uint64_t segments = 0;  ///< files started
  std::uint64_t syncs = 0;
  /// Records passed to the writer but not written because of an error, by RecordKind.
  std::array<std::uint64_t, kRecordKinds> lost{};
};

class RecordingWriter {
 public:
  /// Starts a recording in `folder` (created if needed; by convention `RUN/recording`). The first segment
  /// with its header is on the disk when this returns.
  RecordingWriter(const std::string& folder, const RecordingHeader& header,
                  const RecordingOptions& options = {});
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;
  /// Flushes. Without end() before, readers report the recording as cut off.
  ~RecordingWriter();

  /// `arrival`: when it reached the estimator (for a log, its stamp); must not decrease within the stream.
  Status imu(const ImuSample& sample, Stamp arrival);
  /// kInvalidInput (counted as lost) for a camera number of kMaxCameras or more or an image above 256 MiB.
  Status image(const CameraFrame& frame);
  Status propagateStep(const PropagateStep& step);
  Status trackStep(const TrackStep& step);
  Status smoothStep(const SmoothStep& step);
  Status meshStep(const MeshStep& step);
  Status loopStep(const LoopStep& step);
  /// `scene`: depth and labels that the map used with the frame, may be empty; only the depth values in
  /// metres and the labels are stored. kInvalidInput (counted as lost) for a depth image with another size
  /// than that of the header's sensor, or above 256 MiB.
  Status mapStep(const MapStep& step, const SceneImages& scene);
  /// `count` records of `kind` were lost before the writer because a buffer was full; they would have
  /// followed the last record of that kind.
  Status loss(RecordKind kind, std::uint64_t count);

  Status flush();
  Status sync();
  /// Writes the end mark, syncs and closes. Later records are refused and counted as lost.
  Status end();

  [[nodiscard]] Status status() const { return status_; }
  [[nodiscard]] const RecordingStatistics& statistics() const { return statistics_; }

 private:
  struct WriteResult {
    std::size_t written = 0;
    int error = 0;
  };

  /// Rows of pixels in the caller's memory.
  struct Pixels {
    const std::uint8_t* data = nullptr;
    std::size_t row_bytes = 0;
    std::size_t stride = 0;  ///< bytes per row
    std::size_t rows = 0;

    [[nodiscard]] std::size_t bytes() const { return row_bytes * rows; }
    [[nodiscard]] std::span<const std::uint8_t> row(std::size_t i) const {
      return {data + i * stride, row_bytes};
    }
  };

  void openFolder(const std::string& folder);
  void removeEarlierRun(const std::string& folder);
  int beginSegment();
  void closeFiles();

  Status put(RecordKind kind, const std::uint8_t* payload, std::size_t size);
  static Pixels pixelsOf(const ImageView& image);
  Status putPixels(RecordKind kind, std::span<const std::uint8_t> head, std::span<const Pixels> planes);
  Status putDirect(const RecordHeader& header, std::span<const std::uint8_t> head,
                   std::span<const Pixels> planes);
  void appendHeader(const RecordHeader& header);
  bool makeRoom(std::size_t bytes);
  [[nodiscard]] bool fitsBuffer(std::size_t bytes) const { return filled_ + bytes <= buffer_.size(); }
  WriteResult writeAll(iovec* pieces, std::size_t count) const;
  bool flushBuffer();
  void loseBuffer(std::size_t written);
  void fail(int error);
  Status refuse(RecordKind kind);

  std::vector<std::uint8_t> buffer_;  ///< complete records, except while an image is written directly
  std::size_t filled_ = 0;
  std::size_t segment_bytes_ = 0;
  int folder_ = -1;
  int file_ = -1;
  RunId run_{};
  std::uint32_t run_checksum_ = 0;
  std::optional<DepthImageView> depth_sensor_;
  std::uint32_t segment_ = 0;
  std::uint64_t offset_ = 0;    ///< bytes of the segment that were passed to the kernel
  std::uint64_t sequence_ = 0;  ///< of the next record
  bool ended_ = false;
  Status status_;
  RecordingStatistics statistics_;
};

}  // namespace swiftlet
