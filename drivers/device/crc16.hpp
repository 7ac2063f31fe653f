#pragma once
// The two 16-bit checksums of sensor links, polynomial x^16 + x^12 + x^5 + 1 (0x1021).
//
// crc16Ccitt: most significant bit first; initial value 0 gives CRC-16/XMODEM (VectorNav), 0xFFFF gives
//   CRC-16/CCITT-FALSE (DroneCAN, the bridge framing).
// crc16Mcrf4xx: least significant bit first; initial value 0xFFFF gives CRC-16/MCRF4XX (MAVLink).
// Cost: one look-up per byte in a table of 512 bytes.
// Source: G. Cook, "Catalogue of parametrised CRC algorithms".

#include <array>
#include <cstdint>
#include <span>

namespace swiftlet {
namespace crc16 {

constexpr std::uint16_t kPolynomial = 0x1021;
constexpr std::uint16_t kReflectedPolynomial = 0x8408;
using Table = std::array<std::uint16_t, 256>;

constexpr Table makeTable() {
  Table table{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = byte << 8U;
    for (int bit = 0; bit < 8; ++bit) crc = (crc << 1U) ^ ((crc & 0x8000U) != 0 ? kPolynomial : 0U);
    table[byte] = static_cast<std::uint16_t>(crc);
  }
  return table;
}

constexpr Table makeReflectedTable() {
  Table table{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? kReflectedPolynomial : 0U);
    table[byte] = static_cast<std::uint16_t>(crc);
  }
  return table;
}

inline constexpr Table kTable = makeTable();
inline constexpr Table kReflectedTable = makeReflectedTable();

}  // namespace crc16

/// CRC of `bytes`, continuing from the value `before`.
constexpr std::uint16_t crc16Ccitt(std::uint16_t before, std::span<const std::uint8_t> bytes) {
  std::uint16_t crc = before;
  for (const std::uint8_t byte : bytes) {
    crc = static_cast<std::uint16_t>((crc << 8U) ^ crc16::kTable[((crc >> 8U) ^ byte) & 0xFFU]);
  }
  return crc;
}

constexpr std::uint16_t crc16Mcrf4xx(std::uint16_t before, std::span<const std::uint8_t> bytes) {
  std::uint16_t crc = before;
  for (const std::uint8_t byte : bytes) {
    crc = static_cast<std::uint16_t>((crc >> 8U) ^ crc16::kReflectedTable[(crc ^ byte) & 0xFFU]);
  }
  return crc;
}

}  // namespace swiftlet
