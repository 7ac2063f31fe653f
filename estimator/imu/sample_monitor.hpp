#pragma once
// Checks every IMU sample, and learns from the samples where the noise model is wrong.
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
  bool learned = false;    ///< noise() has changed
};

class SampleMonitor {
 public:
  explicit SampleMonitor(const ImuNoise& noise);

  SampleVerdict check(const ImuSample& sample);

  /// The given noise model, but with the measured rate if that differs by more than 10 %, and with the
  /// saturation limits found in runs of identical extreme readings.
  [[nodiscard]] const ImuNoise& noise() const { return noise_; }

  /// Call if the stream continues at other stamps: the next sample counts as the first. Rate and limits are
  /// kept.
  void restart();

 private:
  // Run of identical readings of one axis.
  struct Run {
    double value = 0;
    int length = 0;
  };

  // Intervals needed before the rate is used.
  static constexpr std::size_t kFirstIntervals = 20;

  void learnRate(double interval);
  bool checkSaturation(const ImuSample& sample);
  bool checkAxis(double value, double floor, Run& run, double& limit);

  ImuNoise noise_;
  std::array<Run, 6> runs_{};
  bool has_last_ = false;
  Stamp last_;
  std::array<double, kFirstIntervals> first_{};  // s, while fewer than kFirstIntervals
  double interval_sum_ = 0;                      // s, of intervals without gaps
  std::uint64_t interval_count_ = 0;
  bool learned_ = false;
};

}  // namespace swiftlet
