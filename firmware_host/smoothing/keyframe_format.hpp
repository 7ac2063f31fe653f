#pragma once
// The layout of keyframes.swk, shared by writer and reader; docs/formats.md has the tables.
//
// Head: magic, version, length, what full smoothing needs to know of the run, CRC. Then records, back to
// back:
//   0 u32 CRC of the rest   4 u16 kind   6 u16 0   8 u32 payload bytes   12 payload
// All CRCs of records continue from the head's, so that a record of another run never passes for one of this.
// Numbers are little-endian, doubles and floats their IEEE 754 bits.

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/core/limits.hpp"

namespace swiftlet::keyframe_file {

inline constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'S', 'W', 'K', '\r', '\n', 0x1A, '\n'};
inline constexpr std::uint32_t kVersion = 2;
inline constexpr std::size_t kPrefixBytes = 16;  ///< magic, version, bytes of the head that follow
inline constexpr std::size_t kMostHead = std::size_t{64} * 1024;
inline constexpr std::size_t kRecordBytes = 12;
inline constexpr std::size_t kCrcBytes = 4;

enum class Kind : std::uint16_t { kImu = 1, kKeyframe = 2, kRevisit = 3, kEnd = 4, kCalibration = 5 };

inline constexpr std::size_t kImuBytes = 56;
inline constexpr std::size_t kCalibrationBytes = 8 + kMaxCameras * 56 + 72;
inline constexpr std::size_t kReadoutBytes = 8;  ///< behind it, of a rolling shutter
inline constexpr std::size_t kStateBytes = 168;  ///< of a keyframe, before its features
inline constexpr std::size_t kFeatureBytes = 28;
inline constexpr std::size_t kRevisitHeadBytes = 364;  ///< before its matches
inline constexpr std::size_t kMatchBytes = 2 * (kFeatureBytes + 4);
inline constexpr std::size_t kMostMatches = 4096;  ///< of a loop
inline constexpr std::size_t kMostPayload = kRevisitHeadBytes + kMostMatches * kMatchBytes;

static_assert(kMostPayload >= kStateBytes + kMaxFeatures * kFeatureBytes);

}  // namespace swiftlet::keyframe_file
