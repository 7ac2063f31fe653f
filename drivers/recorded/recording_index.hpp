#pragma once
// Reads a recording in one pass: checks every record, stores the small ones in memory and the positions of
// the images.
//
// Damage: the recording is used up to its first damaged byte. Everything after it is ignored, because the
// estimator's state after a gap would differ from that in flight. RecordingCut tells where, how much, and how
// many valid records follow (0 after a kill or a power cut, when only the end is missing).
// Errors: InputError with file, byte and remedy if nothing can be replayed (first segment or the run's header
//   damaged), if files do not belong together (foreign file, another version, another run's segment, a
//   renamed segment), or if a valid record has contents that no writer of this version writes.
// Cost: reads all bytes once, at the disk's speed. Memory: 65 bytes per IMU sample, 41 per image, and 16, 64,
//   40 and 56 per propagation, tracking, smoothing and mapping step (vectors: up to twice that).

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/recorded/recording_files.hpp"
#include "drivers/recorded/recording_format.hpp"
#include "drivers/recorded/recording_header.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/step_record.hpp"

namespace swiftlet {

struct RecordedImu {
  ImuSample sample;
  Stamp arrival;
};

struct RecordedImage {
  Stamp stamp;
  Stamp arrival;
  std::uint64_t number = 0;  ///< from 1 within its camera, lost images included
  std::uint64_t offset = 0;  ///< of the record within its segment
  std::uint32_t segment = 0;
  std::uint32_t length = 0;  ///< of the record's payload
};

/// Position of a mapping step's record, which holds its depth image and labels.
struct RecordedScene {
  std::uint64_t offset = 0;  ///< of the record within its segment
  std::uint32_t segment = 0;
  std::uint32_t length = 0;  ///< of the record's payload
};

/// What the stages took, each kind in recorded order.
struct RecordedSteps {
  std::vector<PropagateStep> propagate;
  std::vector<TrackStep> track;
  std::vector<SmoothStep> smooth;
  std::vector<MeshStep> mesh;
  std::vector<LoopStep> loop;
  std::vector<MapStep> map;
};

/// Records that never reached the writer: `count` of `kind`, after number `after` of that kind.
struct RecordingLoss {
  RecordKind kind = RecordKind::kImu;
  std::uint64_t after = 0;
  std::uint64_t count = 0;
  Stamp newest_sample;        ///< stamp of the last IMU sample recorded before; 0: none
  std::uint32_t segment = 0;  ///< segment of the record that reports the loss
  std::uint64_t offset = 0;   ///< byte within that segment
};

struct RecordingCut {
  const char* reason = nullptr;  ///< null: not cut
  std::uint32_t segment = 0;
  std::uint64_t offset = 0;         ///< first byte of the segment's file that is not used
  std::uint64_t bytes = 0;          ///< number of ignored bytes, including later segments
  std::uint64_t sound_records = 0;  ///< valid records among the ignored bytes
};

struct RecordingIndex {
  RecordingHeader header;
  std::uint32_t run_checksum = 0;
  std::vector<RecordedImu> imu;
  std::array<std::vector<RecordedImage>, kMaxCameras> images;
  /// Kind of each message in turn (kImu, kImage0 or kImage1), by RecordingHeader::order.
  std::vector<std::uint8_t> turns;
  RecordedSteps steps;
  std::vector<RecordedScene> scenes;  ///< of each mapping step
  std::vector<RecordingLoss> losses;
  std::uint64_t records = 0;
  bool ended = false;  ///< the end mark is present
  RecordingCut cut;
};

RecordingIndex indexRecording(const RecordingFiles& files);

}  // namespace swiftlet
