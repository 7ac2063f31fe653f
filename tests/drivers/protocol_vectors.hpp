#pragma once
// The files of tests/data/protocols, and bytes as text.

#include <catch2/catch.hpp>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

namespace swiftlet::test {

using Bytes = std::vector<std::uint8_t>;

inline nlohmann::json protocolVectors(const std::string& name) {
  std::ifstream in(std::string(SWIFTLET_TEST_DATA) + "/protocols/" + name);
  REQUIRE(in.good());
  return nlohmann::json::parse(in);
}

inline Bytes bytesOf(const nlohmann::json& entry) {
  const std::string hex = entry["hex"];
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(hex.substr(i, 2), nullptr, 16)));
  return bytes;
}

inline std::string hexOf(std::span<const std::uint8_t> bytes) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string hex;
  for (const std::uint8_t byte : bytes) {
    hex += kDigits[byte >> 4U];
    hex += kDigits[byte & 0xFU];
  }
  return hex;
}

inline const nlohmann::json& named(const nlohmann::json& vectors, const std::string& name) {
  for (const nlohmann::json& frame : vectors["frames"]) {
    if (frame["name"] == name) return frame;
  }
  FAIL("no frame " << name);
  return vectors;
}

inline void append(Bytes& to, std::span<const std::uint8_t> bytes) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// The sizes that every stream is to be fed in; 0: whole.
constexpr std::size_t kPieces[] = {0, 1, 2, 3, 7, 64};

}  // namespace swiftlet::test
