// CRC-32C against published values (RFC 3720, appendix B.4) and the fast form against its twin.

#include <array>
#include <catch2/catch.hpp>
#include <numeric>
#include <string_view>
#include <vector>

#include "drivers/recorded/recording_checksum.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

using Checksum = std::uint32_t (*)(std::uint32_t, std::span<const std::uint8_t>);

TEST_CASE("CRC-32C gives the published values") {
  const Checksum checksum = GENERATE(&crc32c, &crc32cByTable);
  constexpr std::string_view kDigits = "123456789";
  CHECK(checksum(0, {reinterpret_cast<const std::uint8_t*>(kDigits.data()), kDigits.size()}) == 0xE3069283U);
  std::array<std::uint8_t, 32> bytes{};
  CHECK(checksum(0, bytes) == 0x8A9136AAU);
  bytes.fill(0xFF);
  CHECK(checksum(0, bytes) == 0x62A8AB43U);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{0});
  CHECK(checksum(0, bytes) == 0x46DD794EU);
  std::iota(bytes.rbegin(), bytes.rend(), std::uint8_t{0});
  CHECK(checksum(0, bytes) == 0x113FDB5CU);
  CHECK(checksum(0, {}) == 0U);
}

TEST_CASE("the fast CRC-32C equals its twin at every length and place, whole and in two parts") {
  Random random(7);
  std::vector<std::uint8_t> bytes(600);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.below(256));
  const std::span<const std::uint8_t> all(bytes);
  bool same = true;
  for (std::size_t length = 0; length < 300; ++length) {
    const std::span<const std::uint8_t> part = all.subspan(random.below(300), length);
    const std::uint32_t before = random.below(0x7FFFFFFFU);
    const std::uint32_t whole = crc32cByTable(before, part);
    const std::size_t split = random.below(static_cast<std::uint32_t>(length + 1));
    same = same && crc32c(before, part) == whole &&
           crc32c(crc32c(before, part.first(split)), part.subspan(split)) == whole &&
           crc32cByTable(crc32cByTable(before, part.first(split)), part.subspan(split)) == whole;
  }
  CHECK(same);
}

}  // namespace
}  // namespace swiftlet
