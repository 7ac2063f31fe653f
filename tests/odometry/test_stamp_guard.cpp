// Which stamps pass the gate, and when a stream begins a new time line.

#include "estimator/odometry/stamp_guard.hpp"

#include <catch2/catch.hpp>
#include <limits>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/odometry/pairing.hpp"

using namespace swiftlet;

namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kHour = 3'600'000 * kMs;
constexpr double kRate = 200;
constexpr std::int64_t kPeriod = 5 * kMs;
constexpr int kAgreeing = 30;  // 0.15 s

Stamp sampleAt(int k) { return {1000 * kMs + k * kPeriod}; }

bool passes(StampVerdict verdict) {
  return verdict == StampVerdict::kPass || verdict == StampVerdict::kJumped ||
         verdict == StampVerdict::kRestarted;
}

}  // namespace

TEST_CASE("StampGuard: a regular stream with holes passes untouched", "[odometry][stamps]") {
  StampGuard guard(kRate);
  Stamp stamp{};
  Random random(3);
  for (int k = 0; k < 1000; ++k) {
    stamp.ns += random.below(50) == 0 ? 1'400 * kMs : kPeriod;
    REQUIRE(guard.check(stamp) == StampVerdict::kPass);
  }
  CHECK(guard.timeline() == 0);
}

TEST_CASE("StampGuard: one sample far ahead is held out", "[odometry][stamps]") {
  StampGuard guard(kRate);
  for (int k = 0; k < 10; ++k) REQUIRE(guard.check(sampleAt(k)) == StampVerdict::kPass);
  CHECK(guard.check({sampleAt(10).ns + kHour}) == StampVerdict::kHeld);
  CHECK(guard.check(sampleAt(11)) == StampVerdict::kPass);
  // What was held before the stream went on confirms nothing.
  CHECK(guard.check({sampleAt(12).ns + kHour}) == StampVerdict::kHeld);
  CHECK(guard.time().newest == sampleAt(11));
}

TEST_CASE("StampGuard: after a silence the second sample passes", "[odometry][stamps]") {
  StampGuard guard(kRate);
  REQUIRE(guard.check(sampleAt(0)) == StampVerdict::kPass);
  CHECK(guard.check(sampleAt(600)) == StampVerdict::kHeld);
  CHECK(guard.check(sampleAt(601)) == StampVerdict::kJumped);
  CHECK(guard.check(sampleAt(602)) == StampVerdict::kPass);
  CHECK(guard.time().jumps == 1);
  CHECK(guard.timeline() == 0);
}

TEST_CASE("StampGuard: a stream slower than the limit is thinned, not silenced", "[odometry][stamps]") {
  StampGuard guard(0.25);
  int passed = 0;
  for (int k = 0; k < 100; ++k) passed += passes(guard.check({k * 4'000 * kMs})) ? 1 : 0;
  CHECK(passed >= 50);
}

TEST_CASE("StampGuard: a stream that went back restarts after 0.15 s of samples", "[odometry][stamps]") {
  StampGuard guard(kRate);
  REQUIRE(guard.check(sampleAt(100)) == StampVerdict::kPass);
  for (int k = 0; k + 1 < kAgreeing; ++k) REQUIRE(guard.check(sampleAt(k)) == StampVerdict::kBehind);
  CHECK(guard.check(sampleAt(kAgreeing)) == StampVerdict::kRestarted);
  CHECK(guard.timeline() == 1);
  CHECK(guard.check(sampleAt(kAgreeing + 1)) == StampVerdict::kPass);
}

TEST_CASE("StampGuard: repeated and disordered stamps restart nothing", "[odometry][stamps]") {
  StampGuard guard(kRate);
  REQUIRE(guard.check(sampleAt(1000)) == StampVerdict::kPass);
  for (int k = 0; k < 200; ++k) REQUIRE(guard.check(sampleAt(1000)) == StampVerdict::kBehind);
  for (int k = 900; k > 0; --k) REQUIRE(guard.check(sampleAt(k)) == StampVerdict::kBehind);
  for (int k = 0; k < 200; ++k) {  // two streams in one: the newer one goes on
    REQUIRE(guard.check(sampleAt(k)) == StampVerdict::kBehind);
    REQUIRE(guard.check(sampleAt(1001 + k)) == StampVerdict::kPass);
  }
  CHECK(guard.timeline() == 0);
}

TEST_CASE("StampGuard: whatever came before, a stream passes again within 0.2 s", "[odometry][stamps]") {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  for (std::uint64_t run = 0; run < 200; ++run) {
    Random random(7, run);
    StampGuard guard(kRate);
    for (std::uint32_t n = random.below(60); n > 0; --n) {
      const std::int64_t wild = static_cast<std::int64_t>(random.below(1U << 31U)) << random.below(33);
      const Stamp stamps[] = {{wild}, {-wild}, {kMost - random.below(3)}, {kLeast + random.below(3)}};
      (void)guard.check(stamps[random.below(4)]);
    }
    int k = 0;
    while (k < 100 && !passes(guard.check(sampleAt(k)))) ++k;
    INFO("run " << run);
    REQUIRE(k <= 40);
    for (int i = k + 1; i < k + 50; ++i) REQUIRE(passes(guard.check(sampleAt(i))));
  }
}

TEST_CASE("ImageGuard: images far from the IMU are held out, those that agree pass", "[odometry][stamps]") {
  ImageGuard guard;
  ImuTime imu;
  imu.any = true;
  const auto image = [&](int k, std::int64_t by) {
    imu.newest = {k * 50 * kMs};
    return guard.check({k * 50 * kMs + by}, imu);
  };
  for (int k = 0; k < 10; ++k) REQUIRE(image(k, 0) == StampVerdict::kPass);
  for (int k = 10; k < 50; ++k) REQUIRE(image(k, kHour) == StampVerdict::kHeld);
  CHECK(image(50, 0) == StampVerdict::kJumped);  // a hole of two seconds, that the IMU confirms
  CHECK(image(51, 0) == StampVerdict::kPass);
  CHECK(image(52, -kHour) == StampVerdict::kHeld);
  CHECK(image(51, -50 * kMs) == StampVerdict::kBehind);
  // Another epoch: the IMU's stream went back, the image's has not yet.
  ++imu.timeline;
  CHECK(image(52, kHour) == StampVerdict::kHeld);
  CHECK(image(10, 0) == StampVerdict::kPass);
  // The IMU falls silent: images go on.
  for (int k = 11; k < 300; ++k) REQUIRE(guard.check({k * 50 * kMs}, imu) == StampVerdict::kPass);
}

TEST_CASE("ImageGuard: before the first sample every rising image passes", "[odometry][stamps]") {
  ImageGuard guard;
  CHECK(guard.check({kHour}, {}) == StampVerdict::kPass);
  for (int k = 0; k < 3; ++k) CHECK(guard.check({k * 50 * kMs}, {}) == StampVerdict::kBehind);
  CHECK(guard.check({150 * kMs}, {}) == StampVerdict::kRestarted);
}

TEST_CASE("Pairing: an image from far ahead is forgotten when the stream goes on", "[odometry][stamps]") {
  Pairing pairing({});
  const std::uint8_t pixel = 0;
  StereoFrame paired;
  const auto push = [&](std::uint32_t camera, std::int64_t ns) {
    CameraFrame frame;
    frame.camera = camera;
    frame.stamp.ns = ns;
    frame.image = {&pixel, 1, 1, 1};
    return pairing.push(frame, paired);
  };
  // Neither as one that waits nor as one that went out does it hold up those that follow.
  CHECK(push(1, kHour).code == StatusCode::kNotReady);
  if (GENERATE(false, true)) REQUIRE(pairing.flush(paired).ok());
  CHECK(push(0, 50 * kMs).code == StatusCode::kNotReady);
  CHECK(push(1, 50 * kMs).ok());
  CHECK(paired.has(0));
  CHECK(paired.has(1));
}

TEST_CASE("Pairing: after a restart earlier stamps pair", "[odometry][stamps]") {
  Pairing pairing({});
  const std::uint8_t pixel = 0;
  StereoFrame paired;
  for (const std::int64_t ns : {1000 * kMs, 500 * kMs}) {
    for (std::uint32_t camera = 0; camera < 2; ++camera) {
      CameraFrame frame;
      frame.camera = camera;
      frame.stamp.ns = ns;
      frame.image = {&pixel, 1, 1, 1};
      CHECK(pairing.push(frame, paired).ok() == (camera == 1));
    }
    pairing.restart();
  }
  CHECK(pairing.counters().pairs == 2);
}
