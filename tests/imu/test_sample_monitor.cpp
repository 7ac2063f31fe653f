// The gate for IMU samples: what it drops, flags and counts.

#include "estimator/imu/sample_monitor.hpp"

#include <catch2/catch.hpp>
#include <limits>

using namespace swiftlet;

namespace {

ImuSample sampleAt(double seconds, double wobble = 0) {
  return {{Duration::fromSeconds(seconds).ns}, {0.01 + wobble, 0.02, 0.03}, {0.1, 0.2 + wobble, 9.8}};
}

}  // namespace

TEST_CASE("Not finite, repeated and reversed samples are dropped and counted") {
  SampleMonitor monitor{ImuNoise{}};
  CHECK(monitor.check(sampleAt(1.0)).status.ok());
  CHECK(monitor.check(sampleAt(1.0)).status.code == StatusCode::kInvalidInput);
  CHECK(monitor.check(sampleAt(0.995)).status.code == StatusCode::kInvalidInput);
  ImuSample bad = sampleAt(1.005);
  bad.accel.y() = std::numeric_limits<double>::infinity();
  CHECK(monitor.check(bad).status.code == StatusCode::kInvalidInput);
  bad = sampleAt(1.005);
  bad.gyro.z() = std::numeric_limits<double>::quiet_NaN();
  CHECK(monitor.check(bad).status.code == StatusCode::kInvalidInput);
  CHECK(monitor.check(sampleAt(1.005)).status.ok());
  const SampleCounters& n = monitor.counters();
  CHECK(n.accepted == 2);
  CHECK(n.repeated == 1);
  CHECK(n.reversed == 1);
  CHECK(n.not_finite == 2);
}

TEST_CASE("Holes and gaps are told apart") {
  SampleMonitor monitor{ImuNoise{}};
  double t = 1;
  for (int i = 0; i < 50; ++i) {
    const SampleVerdict verdict = monitor.check(sampleAt(t += 0.005));
    CHECK_FALSE(verdict.gap);
  }
  CHECK_FALSE(monitor.check(sampleAt(t += 0.0074)).gap);  // jitter
  CHECK(monitor.counters().short_holes == 0);
  CHECK_FALSE(monitor.check(sampleAt(t += 0.0125)).gap);
  CHECK(monitor.counters().short_holes == 1);
  const SampleVerdict verdict = monitor.check(sampleAt(t += 1.0));
  CHECK(verdict.gap);
  CHECK(verdict.status.ok());
  CHECK(verdict.silence == Approx(1.0));
  CHECK(monitor.counters().gaps == 1);
  CHECK(monitor.counters().gap_seconds == Approx(1.0));
  CHECK(monitor.measuredRate() == Approx(200).epsilon(0.02));
  CHECK_FALSE(monitor.rateMismatch());
}

TEST_CASE("A wrong nominal rate is found, and holes follow the measured one") {
  ImuNoise noise;
  noise.rate_hz = 1000;
  SampleMonitor monitor(noise);
  double t = 0;
  for (int i = 0; i < 200; ++i) (void)monitor.check(sampleAt(t += 0.005));
  CHECK(monitor.rateMismatch());
  CHECK(monitor.measuredRate() == Approx(200));
  const SampleCounters before = monitor.counters();
  CHECK_FALSE(monitor.check(sampleAt(t += 0.005)).gap);
  CHECK(monitor.counters().short_holes == before.short_holes);
  CHECK(monitor.check(sampleAt(t += 0.06)).gap);
}

TEST_CASE("Saturation by the limit, and by runs of one extreme value below it") {
  const ImuNoise noise;
  SampleMonitor monitor(noise);
  ImuSample sample = sampleAt(1);
  sample.accel.z() = -noise.accel_saturation;
  CHECK(monitor.check(sample).saturated);
  double t = 1;
  // A sensor clipping at 8 g beside a calibration that says 16 g.
  bool flagged = false;
  for (int i = 0; i < 8; ++i) {
    sample = sampleAt(t += 0.005, 0.001 * i);
    sample.accel.x() = 78.5;
    flagged = monitor.check(sample).saturated;
  }
  CHECK(flagged);
  CHECK(monitor.accelLimit() == Approx(78.5));
  CHECK(monitor.gyroLimit() == noise.gyro_saturation);
  // Identical moderate readings (a coarse sensor at rest) are none.
  SampleMonitor quiet(noise);
  for (int i = 0; i < 50; ++i) CHECK_FALSE(quiet.check(sampleAt(1 + 0.005 * i)).saturated);
}
