#pragma once
// The layout of a flight recording on disk; docs/formats.md has the tables. Shared by writer and reader.
//
// A recording is a folder of segments recording_000000.swr, recording_000001.swr, ... A segment is a
// header of kSegmentHeaderBytes and then records, back to back. All numbers are little-endian, doubles
// their IEEE 754 bits; every record begins at a multiple of kRecordAlignment in its file.
//
// Record: kRecordHeaderBytes, then the payload, padded with zeros to the alignment.
//   0 u32 CRC of bytes 4 to 23   4 u32 CRC of payload and padding   8 u64 sequence number, from 0
//  16 u32 payload bytes without padding   20 u16 kind   22 u16 kRecordMark
// Both CRCs continue from the CRC of the run's id, so that a record of another run, such as a stale disk
// block of an earlier recording, never passes for one of this run.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "estimator/core/limits.hpp"

namespace swiftlet {

enum class RecordKind : std::uint16_t {
  kRun = 0,  ///< header of the run; always the first record
  kImu = 1,
  kImage0 = 2,
  kImage1 = 3,
  kPropagateStep = 4,
  kTrackStep = 5,
  kSmoothStep = 6,
  kLoss = 7,  ///< records of another kind were lost here
  kEnd = 8,   ///< the recording was closed normally
  kMeshStep = 9,
  kLoopStep = 10,
  kMapStep = 11,
};
inline constexpr std::size_t kRecordKinds = 12;

/// Messages and steps: the records that can be lost before they reach the recorder.
constexpr bool canBeLost(RecordKind kind) {
  return (kind >= RecordKind::kImu && kind <= RecordKind::kSmoothStep) ||
         (kind >= RecordKind::kMeshStep && kind <= RecordKind::kMapStep);
}

constexpr RecordKind imageKind(std::size_t camera) {
  return camera == 0 ? RecordKind::kImage0 : RecordKind::kImage1;
}

/// "IMU samples", "images of camera 0", ... for messages.
const char* pluralName(RecordKind kind);

inline constexpr std::uint32_t kRecordingVersion = 1;
/// Like PNG's signature: a non-ASCII byte, both line ends and an end-of-file character detect any damage by
/// transfer as text.
inline constexpr std::array<std::uint8_t, 8> kSegmentMagic{0x89, 'S', 'W', 'R', '\r', '\n', 0x1A, '\n'};
inline constexpr std::size_t kSegmentHeaderBytes = 64;
inline constexpr std::size_t kRecordHeaderBytes = 24;
inline constexpr std::size_t kRecordAlignment = 8;
inline constexpr std::uint16_t kRecordMark = 0x7253;
/// Largest payload: beyond any camera; it bounds a reader's memory for malicious input.
inline constexpr std::size_t kMaxPayloadBytes = 256U << 20U;
inline constexpr std::uint32_t kMaxSegments = 1'000'000;

inline constexpr std::size_t kImuPayloadBytes = 64;
inline constexpr std::size_t kImageHeadBytes = 40;  ///< followed by width * height pixels
inline constexpr std::size_t kPropagateStepBytes = 16;
inline constexpr std::size_t kTrackStepBytes = 64;
inline constexpr std::size_t kSmoothStepBytes = 40;
inline constexpr std::size_t kSmoothStepBytesBeforePlanes = 32;  ///< as in older programs, without planes
inline constexpr std::size_t kMeshStepBytes = 24;
inline constexpr std::size_t kLoopStepBytes = 32;
inline constexpr std::size_t kMapStepHeadBytes = 80;  ///< followed by depth and labels, if any
inline constexpr std::size_t kMapStepSceneAt = 48;    ///< offset of the scene's stamp in it
inline constexpr std::size_t kLossBytes = 16;
inline constexpr std::size_t kEndBytes = 8;

constexpr std::size_t paddedSize(std::size_t bytes) {
  return (bytes + kRecordAlignment - 1) / kRecordAlignment * kRecordAlignment;
}

using RunId = std::array<std::uint8_t, 16>;

struct SegmentHeader {
  std::uint32_t version = kRecordingVersion;
  std::uint32_t segment = 0;
  RunId run{};
  std::uint64_t first_sequence = 0;  ///< of the segment's first record
};

struct RecordHeader {
  RecordKind kind = RecordKind::kRun;
  std::uint64_t sequence = 0;
  std::uint32_t length = 0;       ///< payload without padding
  std::uint32_t payload_crc = 0;  ///< of payload and padding, continued from the run's CRC
};

/// recording_000042.swr as a null-terminated text.
using SegmentName = std::array<char, 24>;
SegmentName segmentName(std::uint32_t segment);
/// Parses the number in such a file name; false for any other name.
bool parseSegmentName(const std::string& name, std::uint32_t& segment);

/// The CRC that all CRCs of a run's records continue from.
std::uint32_t runChecksum(const RunId& run);

void encode(const SegmentHeader& header, std::span<std::uint8_t, kSegmentHeaderBytes> out);
void encode(const RecordHeader& header, std::uint32_t run_checksum,
            std::span<std::uint8_t, kRecordHeaderBytes> out);

enum class SegmentHeaderState : std::uint8_t {
  kGood,
  kForeign,       ///< does not start with the magic bytes
  kDamaged,       ///< the checksum is wrong
  kOtherVersion,  ///< `version` is not kRecordingVersion; the checksum is right
};
SegmentHeaderState decode(std::span<const std::uint8_t, kSegmentHeaderBytes> in, SegmentHeader& header);
/// False if this is not a valid record header of the run.
bool decode(std::span<const std::uint8_t, kRecordHeaderBytes> in, std::uint32_t run_checksum,
            RecordHeader& header);

}  // namespace swiftlet
