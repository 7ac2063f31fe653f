#pragma once
// One pass over a recording: every record checked, the small ones taken into memory, the images found.
//
// Damage: the recording is good up to the first byte that is not, wherever that is. What follows is
// left out, because the estimator's state after a hole is not the one that flew; RecordingCut says where, how
// much, and how many sound records lie behind (0 after a kill or a power cut: only the tail is gone).
// Errors: InputError with file, byte and remedy where nothing can be replayed (first segment or the run's
//   header damaged), or where files do not belong together (foreign file, another version, another run's
//   segment, a renamed segment), or a sound record has contents that no writer of this version writes.
// Cost: reads all bytes once, at the disk's speed. Memory: 65 bytes an IMU sample, 41 an
//   image, 16, 64, 40 and 56 a propagation, tracking, smoothing and mapping step (vectors: up to twice that).

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
  std::uint64_t number = 0;  ///< from 1 within its camera, lost ones counted
  std::uint64_t offset = 0;  ///< of the record within its segment
  std::uint32_t segment = 0;
  std::uint32_t length = 0;  ///< of the record's payload
};

/// Where a mapping step's record is, with its depth image and its labels.
struct RecordedScene {
  std::uint64_t offset = 0;  ///< of the record within its segment
  std::uint32_t segment = 0;
  std::uint32_t length = 0;  ///< of the record's payload
};

/// What the stages took, each kind in the order of recording.
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
  Stamp newest_sample;        ///< stamp of the IMU sample recorded before; 0: none was
  std::uint32_t segment = 0;  ///< position of the record that reports it
  std::uint64_t offset = 0;   ///< byte within that segment
};

struct RecordingCut {
  const char* reason = nullptr;  ///< null: nothing was cut
  std::uint32_t segment = 0;
  std::uint64_t offset = 0;         ///< byte of the segment's file from which on nothing is used
  std::uint64_t bytes = 0;          ///< left out, later segments included
  std::uint64_t sound_records = 0;  ///< among these
};

struct RecordingIndex {
  RecordingHeader header;
  std::uint32_t run_checksum = 0;
  std::vector<RecordedImu> imu;
  std::array<std::vector<RecordedImage>, kMaxCameras> images;
  /// kImu, kImage0 or kImage1: the kind of the next message, by RecordingHeader::order.
  std::vector<std::uint8_t> turns;
  RecordedSteps steps;
  std::vector<RecordedScene> scenes;  ///< of each mapping step
  std::vector<RecordingLoss> losses;
  std::uint64_t records = 0;
  bool ended = false;  ///< the end mark is there
  RecordingCut cut;
};

RecordingIndex indexRecording(const RecordingFiles& files);

}  // namespace swiftlet
