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

TEST_CASE("Not finite, repeated and reversed samples are dropped") {
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
}

TEST_CASE("Holes and gaps are told apart") {
  SampleMonitor monitor{ImuNoise{}};
  double t = 1;
  for (int i = 0; i < 50; ++i) {
    const SampleVerdict verdict = monitor.check(sampleAt(t += 0.005));
    CHECK_FALSE(verdict.gap);
  }
  CHECK_FALSE(monitor.check(sampleAt(t += 0.0074)).gap);  // jitter
  CHECK_FALSE(monitor.check(sampleAt(t += 0.0125)).gap);
  const SampleVerdict verdict = monitor.check(sampleAt(t += 1.0));
  CHECK(verdict.gap);
  CHECK(verdict.status.ok());
  CHECK(verdict.silence == Approx(1.0));
  CHECK_FALSE(verdict.learned);
  CHECK(monitor.noise().rate_hz == 200);
}

TEST_CASE("A wrong nominal rate is found, with a hole among the first samples too, and gaps follow it") {
  for (const double nominal : {1000.0, 20.0}) {
    for (const double hole : {0.0, 1.0}) {
      INFO("told " << nominal << " Hz, a hole of " << hole << " s");
      ImuNoise noise;
      noise.rate_hz = nominal;
      SampleMonitor monitor(noise);
      double t = 0;
      int learned = 0;
      for (int i = 0; i < 200; ++i) {
        if (i == 7) t += hole;
        learned += monitor.check(sampleAt(t += 0.005)).learned ? 1 : 0;
      }
      CHECK(learned == 1);
      CHECK(monitor.noise().rate_hz == Approx(200));
      CHECK(monitor.noise().gyro_density == noise.gyro_density);
      CHECK_FALSE(monitor.check(sampleAt(t += 0.045)).gap);
      CHECK(monitor.check(sampleAt(t += 0.06)).gap);
    }
  }
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
  CHECK(monitor.noise().accel_saturation == Approx(78.5));
  CHECK(monitor.noise().gyro_saturation == noise.gyro_saturation);
  // Identical moderate readings (a coarse sensor at rest) are none.
  SampleMonitor quiet(noise);
  for (int i = 0; i < 50; ++i) CHECK_FALSE(quiet.check(sampleAt(1 + 0.005 * i)).saturated);
}
