#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "drivers/recorded/parse_number.hpp"
#include "drivers/recorded/trajectory_file.hpp"

namespace swiftlet {
namespace {

TEST_CASE("decimal seconds keep every nanosecond", "[numbers]") {
  Stamp stamp;
  REQUIRE(parseSeconds("1403636584.763555584", stamp));
  CHECK(stamp.ns == 1403636584763555584);
  REQUIRE(parseSeconds("0.05", stamp));
  CHECK(stamp.ns == 50'000'000);
  REQUIRE(parseSeconds("-1.25", stamp));
  CHECK(stamp.ns == -1'250'000'000);
  REQUIRE(parseSeconds("-0.5", stamp));
  CHECK(stamp.ns == -500'000'000);
  REQUIRE(parseSeconds("7", stamp));
  CHECK(stamp.ns == 7'000'000'000);
  REQUIRE(parseSeconds("1.1234567899", stamp));
  CHECK(stamp.ns == 1'123'456'789);
  for (const char* bad : {"", ".", "1.4e9", "nan", "1.2.3", "99999999999", "1.-5", "0x10", "1,5"}) {
    INFO(bad);
    CHECK(!parseSeconds(bad, stamp));
  }
}

TEST_CASE("formatted seconds read back to the same nanosecond", "[numbers]") {
  for (const std::int64_t ns : {std::int64_t{1403636579763555584}, std::int64_t{0}, std::int64_t{1},
                                std::int64_t{-1}, std::int64_t{999'999'999}, std::int64_t{-1'000'000'001}}) {
    Stamp stamp;
    REQUIRE(parseSeconds(formatSeconds({ns}), stamp));
    CHECK(stamp.ns == ns);
  }
  CHECK(formatSeconds({1403636579763555584}) == "1403636579.763555584");
  CHECK(formatSeconds({-5}) == "-0.000000005");
  CHECK(formatSeconds({std::numeric_limits<std::int64_t>::min()}) == "-9223372036.854775808");
}

TEST_CASE("csv stamps: integers are nanoseconds, points mean seconds", "[numbers]") {
  Stamp stamp;
  REQUIRE(parseCsvStamp("5000000", stamp));
  CHECK(stamp.ns == 5'000'000);
  REQUIRE(parseCsvStamp("1403636579.5", stamp));
  CHECK(stamp.ns == 1403636579500000000);
  REQUIRE(parseNanoseconds("1403636579763555584.000000", stamp));
  CHECK(stamp.ns == 1403636579763555584);
  CHECK(!parseCsvStamp("1.40363657976356E+018", stamp));
  CHECK(!parseCsvStamp("99999999999999999999", stamp));
  CHECK(!parseCsvStamp("", stamp));
}

TEST_CASE("numbers are whole fields", "[numbers]") {
  double value = 0;
  CHECK(parseDouble("+1.5e-3", value));
  CHECK(value == 1.5e-3);
  CHECK(parseDouble("nan", value));
  CHECK(std::isnan(value));
  for (const char* bad : {"", "+", "1.5x", "1 2", "--1", "text"}) CHECK(!parseDouble(bad, value));
}

}  // namespace
}  // namespace swiftlet
