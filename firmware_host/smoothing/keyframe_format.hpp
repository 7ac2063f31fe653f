#pragma once
// The layout of keyframes.swk, shared by writer and reader; docs/formats.md has the tables.
//
// Head: magic, version, length, facts about the run that full smoothing needs, CRC. Then records, back to
// back:
//   0 u32 CRC of the rest   4 u16 kind   6 u16 0   8 u32 payload bytes   12 payload
// The CRC of each record continues from the head's, so that a record of another run is never accepted.
// Numbers are little-endian; doubles and floats are IEEE 754.

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/core/limits.hpp"

namespace swiftlet::keyframe_file {

inline constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'S', 'W', 'K', '\r', '\n', 0x1A, '\n'};
inline constexpr std::uint32_t kVersion = 2;
inline constexpr std::size_t kPrefixBytes = 16;  ///< magic, version, size of the rest of the head
inline constexpr std::size_t kMostHead = std::size_t{64} * 1024;
inline constexpr std::size_t kRecordBytes = 12;
inline constexpr std::size_t kCrcBytes = 4;

enum class Kind : std::uint16_t { kImu = 1, kKeyframe = 2, kRevisit = 3, kEnd = 4, kCalibration = 5 };

inline constexpr std::size_t kImuBytes = 56;
inline constexpr std::size_t kCalibrationBytes = 8 + kMaxCameras * 56 + 72;
inline constexpr std::size_t kReadoutBytes = 8;  ///< after the calibration, only for a rolling shutter
inline constexpr std::size_t kStateBytes = 168;  ///< per keyframe, before its features
inline constexpr std::size_t kFeatureBytes = 28;
inline constexpr std::size_t kRevisitHeadBytes = 364;  ///< per loop, before its matches
inline constexpr std::size_t kMatchBytes = 2 * (kFeatureBytes + 4);
inline constexpr std::size_t kMostMatches = 4096;  ///< per loop
inline constexpr std::size_t kMostPayload = kRevisitHeadBytes + kMostMatches * kMatchBytes;

static_assert(kMostPayload >= kStateBytes + kMaxFeatures * kFeatureBytes);

}  // namespace swiftlet::keyframe_file
