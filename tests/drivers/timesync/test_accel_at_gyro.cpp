// A gyroscope and an accelerometer apart, beside what one sensor would have measured.

#include <catch2/catch.hpp>
#include <cstdint>
#include <vector>

#include "drivers/timesync/accel_at_gyro.hpp"
#include "tests/drivers/timesync/units.hpp"

namespace swiftlet {
namespace {

using test::kMs;

/// Linear in time, so that interpolation is exact.
Eigen::Vector3d accelAt(Stamp stamp) {
  const double t = static_cast<double>(stamp.ns) * 1e-9;
  return {t, -2 * t, 9.81 + 0.5 * t};
}
AccelAtGyro::Sample gyroAt(std::int64_t ms, std::int64_t arrival_ms) {
  return {{ms * kMs}, {arrival_ms * kMs}, Eigen::Vector3d(static_cast<double>(ms), 0, 1)};
}
AccelAtGyro::Sample accelSample(std::int64_t ms, std::int64_t arrival_ms) {
  return {{ms * kMs}, {arrival_ms * kMs}, accelAt({ms * kMs})};
}
std::vector<ImuReading> drain(AccelAtGyro& joined, std::int64_t now_ms) {
  std::vector<ImuReading> all;
  for (ImuReading reading; joined.next({now_ms * kMs}, reading);) all.push_back(reading);
  return all;
}

TEST_CASE("each gyro sample gets the acceleration of its instant") {
  AccelAtGyro joined;
  std::vector<ImuReading> all;
  for (std::int64_t ms = 0; ms < 1000; ++ms) {
    if (ms % 5 == 0) joined.addGyro(gyroAt(ms, ms));
    if (ms % 16 == 3) joined.addAccel(accelSample(ms, ms));
    for (const ImuReading& reading : drain(joined, ms)) {
      REQUIRE(reading.host);
      const std::int64_t stamp = reading.host->ns / kMs;
      CHECK(ms - stamp < 16);
      CHECK(reading.gyro.x() == static_cast<double>(stamp));
      CHECK((reading.accel - accelAt(*reading.host)).norm() < 1e-12);
      all.push_back(reading);
    }
  }
  // Of the gyro's 200, the first has no neighbour before it, and the last ones wait.
  CHECK(all.size() >= 195);
  CHECK(joined.counters().unpaired == 1);
  for (std::size_t i = 1; i < all.size(); ++i) CHECK((*all[i].host - *all[i - 1].host).ns == 5 * kMs);
}

TEST_CASE("equal stamps are one sample") {
  AccelAtGyro joined;
  for (std::int64_t ms = 0; ms < 50; ms += 5) {
    joined.addGyro(gyroAt(ms, ms));
    joined.addAccel(accelSample(ms, ms));
    const auto samples = drain(joined, ms);
    REQUIRE(samples.size() == 1);
    CHECK((samples[0].accel - accelAt({ms * kMs})).norm() == 0);
  }
}

TEST_CASE("gyro samples wait for the accelerometer so long and no longer") {
  AccelAtGyro joined;
  joined.addAccel(accelSample(0, 0));
  for (std::int64_t ms = 1; ms < 100; ms += 5) joined.addGyro(gyroAt(ms, ms));
  CHECK(drain(joined, 50).empty());
  // Those that have waited for 50 ms are given up.
  CHECK(drain(joined, 90).empty());
  CHECK(joined.counters().unpaired == 8);
  // Two are too far from the accelerometer's sample before, one is of its instant.
  joined.addAccel(accelSample(51, 90));
  CHECK(drain(joined, 90).size() == 1);
  joined.addAccel(accelSample(70, 90));
  CHECK(drain(joined, 90).size() == 3);
  CHECK(joined.counters().unpaired == 10);
}

TEST_CASE("what is late, repeated or too much is counted") {
  AccelAtGyro joined;
  joined.addGyro(gyroAt(10, 10));
  joined.addGyro(gyroAt(10, 11));
  joined.addGyro(gyroAt(5, 12));
  joined.addAccel(accelSample(10, 10));
  joined.addAccel(accelSample(9, 10));
  CHECK(joined.counters().stale == 3);
  CHECK(drain(joined, 12).size() == 1);
  for (std::int64_t ms = 20; ms < 1000; ++ms) joined.addGyro(gyroAt(ms, 20));
  CHECK(joined.counters().overrun == 980 - 512);
}

}  // namespace
}  // namespace swiftlet
