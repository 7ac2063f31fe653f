#pragma once
// How often in a row an IMU has given one reading: a sensor that hangs repeats its last one.
//
// Of the thread that takes the samples. Cost: six comparisons a sample.

#include <cstdint>

#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

class EqualReadings {
 public:
  /// Equal readings in a row, this one included; the stamp does not count.
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
