#pragma once
// Layout and checksum shared by the reader and the writer of MCAP files. All numbers are little-endian.
// Source: the MCAP specification, version 0 (github.com/foxglove/mcap, website/docs/spec).

#include <zlib.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace swiftlet::mcap {

inline constexpr std::array<std::uint8_t, 8> kMagic = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

enum class Op : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kDataEnd = 0x0F,
};

inline constexpr std::size_t kRecordHead = 9;      ///< opcode, length of the content
inline constexpr std::size_t kMessageHead = 22;    ///< channel, sequence, log time, publish time
inline constexpr std::size_t kFooterContent = 20;  ///< start of the summary, of its offsets, checksum

/// `crc` continued over `bytes`; begin with 0.
inline std::uint32_t crcOf(std::uint32_t crc, std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(::crc32_z(crc, bytes.data(), bytes.size()));
}

}  // namespace swiftlet::mcap
