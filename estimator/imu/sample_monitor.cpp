#include "estimator/imu/sample_monitor.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/imu/integration_rule.hpp"

namespace swiftlet {
namespace {

// Intervals before the measured rate is believed.
constexpr std::uint64_t kMinIntervals = 20;
// Relative difference from the nominal rate that counts as a wrong calibration.
constexpr double kRateTolerance = 0.1;
// The interval's mean follows the newest this many intervals (clock drift, temperature).
constexpr std::uint64_t kIntervalMemory = 4000;
// So many equal readings in a row, at an extreme, show a clipped axis: noise moves the last digit
// of an axis that still measures, and 5 samples (25 ms at 200 Hz) are too many for chance.
constexpr int kClippedRun = 5;
// Only readings beyond these are extremes: a quarter of the smallest common ranges (250 deg/s, 2 g)
// would be normal flight, the full ranges are not.
constexpr double kExtremeGyro = 4.3;    // rad/s
constexpr double kExtremeAccel = 19.0;  // m/s^2

}  // namespace

SampleMonitor::SampleMonitor(const ImuNoise& noise)
    : noise_(noise), gyro_limit_(noise.gyro_saturation), accel_limit_(noise.accel_saturation) {}

double SampleMonitor::period() const { return rateMismatch() ? 1.0 / measuredRate() : 1.0 / noise_.rate_hz; }

double SampleMonitor::measuredRate() const {
  if (interval_count_ < kMinIntervals || interval_sum_ <= 0) return 0;
  return static_cast<double>(interval_count_) / interval_sum_;
}

bool SampleMonitor::rateMismatch() const {
  const double rate = measuredRate();
  return rate > 0 && std::abs(rate - noise_.rate_hz) > kRateTolerance * noise_.rate_hz;
}

SampleVerdict SampleMonitor::check(const ImuSample& sample) {
  SampleVerdict verdict;
  if (!sample.gyro.allFinite() || !sample.accel.allFinite()) {
    ++counters_.not_finite;
    verdict.status = {StatusCode::kInvalidInput, "IMU sample is not finite"};
    return verdict;
  }
  if (has_last_ && sample.stamp <= last_) {
    ++(sample.stamp == last_ ? counters_.repeated : counters_.reversed);
    verdict.status = {StatusCode::kInvalidInput, "IMU stamp repeated or reversed"};
    return verdict;
  }
  if (has_last_) {
    verdict.silence = (sample.stamp - last_).seconds();
    const double periods = verdict.silence / period();
    verdict.gap = periods > kGapPeriods;
    counters_.longest_silence = std::max(counters_.longest_silence, verdict.silence);
    if (verdict.gap) {
      ++counters_.gaps;
      counters_.gap_seconds += verdict.silence;
    } else if (periods > kRegularPeriods) {
      ++counters_.short_holes;
    }
    // While the rate is unknown every interval teaches it: the nominal rate may be wrong.
    if (periods <= kRegularPeriods || interval_count_ < kMinIntervals) {
      interval_sum_ += verdict.silence;
      if (++interval_count_ > kIntervalMemory) {
        interval_sum_ *= 0.5;
        interval_count_ /= 2;
      }
    }
  }
  verdict.saturated = checkSaturation(sample);
  if (verdict.saturated) ++counters_.saturated;
  ++counters_.accepted;
  has_last_ = true;
  last_ = sample.stamp;
  return verdict;
}

bool SampleMonitor::checkSaturation(const ImuSample& sample) {
  bool saturated = false;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    saturated |= checkAxis(sample.gyro[axis], kExtremeGyro, runs_[i], gyro_limit_);
    saturated |= checkAxis(sample.accel[axis], kExtremeAccel, runs_[i + 3], accel_limit_);
  }
  return saturated;
}

bool SampleMonitor::checkAxis(double value, double floor, Run& run, double& limit) {
  run.length = value == run.value ? run.length + 1 : 1;
  run.value = value;
  if (run.length >= kClippedRun && std::abs(value) > floor) limit = std::min(limit, std::abs(value));
  return std::abs(value) >= limit;
}

void SampleMonitor::restart() {
  has_last_ = false;
  runs_ = {};
}

void SampleMonitor::reset() { *this = SampleMonitor(noise_); }

}  // namespace swiftlet
