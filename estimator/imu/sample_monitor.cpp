#include "estimator/imu/sample_monitor.hpp"

#include <cmath>

#include "estimator/core/median.hpp"
#include "estimator/imu/integration_rule.hpp"

namespace swiftlet {
namespace {

// Relative difference from the nominal rate that counts as a wrong calibration.
constexpr double kRateTolerance = 0.1;
// The mean interval follows about this many newest intervals (clock drift, temperature).
constexpr std::uint64_t kIntervalMemory = 4000;
// This many equal extreme readings in a row mean a clipped axis: on a working axis noise changes the last
// digit, and 5 samples (25 ms at 200 Hz) are too many for chance.
constexpr int kClippedRun = 5;
// Only readings beyond these count as extreme: about the smallest common ranges (250 deg/s, 2 g). A quarter
// of them would be normal flight.
constexpr double kExtremeGyro = 4.3;    // rad/s
constexpr double kExtremeAccel = 19.0;  // m/s^2

}  // namespace

SampleMonitor::SampleMonitor(const ImuNoise& noise) : noise_(noise) {}

SampleVerdict SampleMonitor::check(const ImuSample& sample) {
  SampleVerdict verdict;
  if (!sample.gyro.allFinite() || !sample.accel.allFinite()) {
    verdict.status = {StatusCode::kInvalidInput, "IMU sample is not finite"};
    return verdict;
  }
  if (has_last_ && sample.stamp <= last_) {
    verdict.status = {StatusCode::kInvalidInput, "IMU stamp repeated or reversed"};
    return verdict;
  }
  learned_ = false;
  if (has_last_) {
    verdict.silence = (sample.stamp - last_).seconds();
    verdict.gap = verdict.silence * noise_.rate_hz > kGapPeriods;
    learnRate(verdict.silence);
  }
  verdict.saturated = checkSaturation(sample);
  verdict.learned = learned_;
  has_last_ = true;
  last_ = sample.stamp;
  return verdict;
}

void SampleMonitor::learnRate(double interval) {
  if (interval_count_ < kFirstIntervals) {
    first_[interval_count_++] = interval;
    if (interval_count_ < kFirstIntervals) return;
    // Use the median: some intervals may contain gaps, and the nominal rate may be wrong.
    interval_sum_ = medianOf(first_) * kFirstIntervals;
  } else {
    const double mean = interval_sum_ / static_cast<double>(interval_count_);
    if (interval > kRegularPeriods * mean) return;
    interval_sum_ += interval;
    if (++interval_count_ > kIntervalMemory) {
      interval_sum_ *= 0.5;
      interval_count_ /= 2;
    }
  }
  const double rate = static_cast<double>(interval_count_) / interval_sum_;
  if (std::abs(rate - noise_.rate_hz) <= kRateTolerance * noise_.rate_hz) return;
  noise_.rate_hz = rate;
  learned_ = true;
}

bool SampleMonitor::checkSaturation(const ImuSample& sample) {
  bool saturated = false;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    saturated |= checkAxis(sample.gyro[axis], kExtremeGyro, runs_[i], noise_.gyro_saturation);
    saturated |= checkAxis(sample.accel[axis], kExtremeAccel, runs_[i + 3], noise_.accel_saturation);
  }
  return saturated;
}

bool SampleMonitor::checkAxis(double value, double floor, Run& run, double& limit) {
  run.length = value == run.value ? run.length + 1 : 1;
  run.value = value;
  if (run.length >= kClippedRun && std::abs(value) > floor && std::abs(value) < limit) {
    limit = std::abs(value);
    learned_ = true;
  }
  return std::abs(value) >= limit;
}

void SampleMonitor::restart() {
  has_last_ = false;
  runs_ = {};
}

}  // namespace swiftlet
