#pragma once
// Joins a gyroscope and an accelerometer that send separately into one inertial sensor: the accelerometer is
// interpolated linearly to each gyro stamp. Both must stamp with the same clock.
//
// A gyro sample waits for an accelerometer sample at or after its stamp, but at most kPatience after its own
// arrival. It is dropped if none comes by then, if it is older than every accelerometer sample, or if its two
// neighbours are more than kLongestGap apart. A sample that is not newer than the previous one of its kind is
// dropped too. All drops are counted. Linear interpolation costs only accelerometer bandwidth, which its rate
// limits anyway.
//
// Threads: one. Memory: fixed, 0.6 s of the fastest sensors. Cost: O(1) per sample.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "drivers/device/imu_reading.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class AccelAtGyro {
 public:
  /// Three periods of the slowest accelerometer found in cameras, 63 Hz.
  static constexpr Duration kPatience = Duration::fromMilliseconds(50);
  static constexpr Duration kLongestGap = Duration::fromMilliseconds(50);

  struct Sample {
    Stamp stamp;
    Stamp arrival;
    Eigen::Vector3d value = Eigen::Vector3d::Zero();
  };

  struct Counters {
    std::uint64_t stale = 0;     ///< not newer than the previous sample of its kind
    std::uint64_t unpaired = 0;  ///< gyro samples without usable accelerometer neighbours
    std::uint64_t overrun = 0;   ///< gyro samples lost because the queue was full
  };

  void addGyro(const Sample& sample) { add(gyro_, sample); }
  void addAccel(const Sample& sample) { add(accel_, sample); }
  /// Takes the next gyro sample that can be completed at time `now`; false: none. `reading.host` is the
  /// gyro's stamp.
  bool next(Stamp now, ImuReading& reading);
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  static constexpr std::size_t kRoom = 512;
  struct Queue {
    std::array<Sample, kRoom> samples;
    std::size_t first = 0;
    std::size_t count = 0;

    [[nodiscard]] const Sample& at(std::size_t i) const { return samples[(first + i) % kRoom]; }
    void pop() {
      first = (first + 1) % kRoom;
      --count;
    }
    Stamp newest;
    bool any = false;
  };

  void add(Queue& queue, const Sample& sample);

  Queue gyro_;
  Queue accel_;
  Counters counters_;
};

}  // namespace swiftlet
