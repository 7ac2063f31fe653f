#pragma once
// Counts consecutive equal readings of an IMU: a sensor that hangs repeats its last one.
//
// For the thread that takes the samples. Cost: six comparisons per sample.

#include <cstdint>

#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

class EqualReadings {
 public:
  /// Returns the number of consecutive equal readings, this one included; stamps are not compared.
  std::uint64_t note(const ImuSample& sample) {
    const bool equal = run_ > 0 && sample.gyro == before_.gyro && sample.accel == before_.accel;
    run_ = equal ? run_ + 1 : 1;
    before_ = sample;
    return run_;
  }

 private:
  ImuSample before_{};
  std::uint64_t run_ = 0;
};

}  // namespace swiftlet
