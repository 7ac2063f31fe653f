#pragma once
// Checks every IMU sample: drops, flags and counts.
//
// Drops samples that are not finite or whose stamp is repeated or reversed. Finds gaps, measures the rate,
// and flags saturated samples: a component at or beyond the noise model's limit, or a run of identical
// extreme readings, which shows a lower limit than that of the calibration. Errors: kInvalidInput in
// `verdict.status` for a dropped sample. Cost: some 20 ns; no allocation.

#include <array>
#include <cstdint>

#include "estimator/core/status.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

struct SampleVerdict {
  Status status;           ///< ok: use it; kInvalidInput: drop it
  bool saturated = false;  ///< use it with raised noise
  bool gap = false;        ///< more than kGapPeriods without a sample before it
  double silence = 0;      ///< s since the previous sample, 0 for the first
};

struct SampleCounters {
  std::uint64_t accepted = 0;
  std::uint64_t not_finite = 0;
  std::uint64_t repeated = 0;     ///< stamp equal to the last one
  std::uint64_t reversed = 0;     ///< stamp before the last one
  std::uint64_t short_holes = 0;  ///< more than 1.5 periods, but no gap
  std::uint64_t gaps = 0;         ///< more than kGapPeriods
  std::uint64_t saturated = 0;
  double gap_seconds = 0;      ///< sum over the gaps
  double longest_silence = 0;  ///< s
};

class SampleMonitor {
 public:
  explicit SampleMonitor(const ImuNoise& noise);

  SampleVerdict check(const ImuSample& sample);

  [[nodiscard]] const SampleCounters& counters() const { return counters_; }
  /// Hz, from the mean interval of accepted samples without holes; 0 before 20 samples.
  [[nodiscard]] double measuredRate() const;
  /// True if the measured rate is known and differs from the nominal rate by more than 10 %: the
  /// calibration's rate is wrong, and gap limits follow the measured rate.
  [[nodiscard]] bool rateMismatch() const;
  /// The limits in use: the calibration's, or lower ones shown by a run of identical extremes.
  [[nodiscard]] double gyroLimit() const { return gyro_limit_; }
  [[nodiscard]] double accelLimit() const { return accel_limit_; }

  /// Call if the stream continues at other stamps: the next sample is the first. Counters, rate and limits
  /// are kept.
  void restart();
  void reset();

 private:
  // Run of identical readings of one axis.
  struct Run {
    double value = 0;
    int length = 0;
  };

  [[nodiscard]] double period() const;
  bool checkSaturation(const ImuSample& sample);
  bool checkAxis(double value, double floor, Run& run, double& limit);

  ImuNoise noise_;
  double gyro_limit_;
  double accel_limit_;
  std::array<Run, 6> runs_{};
  SampleCounters counters_;
  bool has_last_ = false;
  Stamp last_;
  double interval_sum_ = 0;
  std::uint64_t interval_count_ = 0;
};

}  // namespace swiftlet
