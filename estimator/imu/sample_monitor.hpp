#pragma once
// Checks every IMU sample, and learns from them what the noise model has wrong.
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

  /// As given, but with the rate of the samples if that differs by more than 10 %, and with the limits that
  /// runs of identical extremes show.
  [[nodiscard]] const ImuNoise& noise() const { return noise_; }

  /// Call if the stream continues at other stamps: the next sample is the first. Rate and limits are kept.
  void restart();

 private:
  // Run of identical readings of one axis.
  struct Run {
    double value = 0;
    int length = 0;
  };

  // Before so many the rate is not believed.
  static constexpr std::size_t kFirstIntervals = 20;

  void learnRate(double interval);
  bool checkSaturation(const ImuSample& sample);
  bool checkAxis(double value, double floor, Run& run, double& limit);

  ImuNoise noise_;
  std::array<Run, 6> runs_{};
  bool has_last_ = false;
  Stamp last_;
  std::array<double, kFirstIntervals> first_{};  // s, until there are all
  double interval_sum_ = 0;                      // s, of intervals without a hole
  std::uint64_t interval_count_ = 0;
  bool learned_ = false;
};

}  // namespace swiftlet
