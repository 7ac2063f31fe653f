#pragma once
// A gyroscope and an accelerometer that send apart, as one inertial sensor: at each gyro sample the
// accelerometer's value, linear between its two neighbours. Both stamp by one clock.
//
// A gyro sample waits until an accelerometer sample that is not older has come, and no longer than
// kPatience after its own arrival; it is left out then, and where the neighbours are more than kLongestGap
// apart or older than it all. Samples that are not newer than the one before of their kind are left out too.
// All of these are counted. What linear interpolation costs: the accelerometer's own bandwidth, which its
// rate bounds anyway.
//
// Threads: one. Memory: fixed, 0.6 s of the fastest sensors. Cost: O(1) a sample.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "drivers/device/imu_reading.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class AccelAtGyro {
 public:
  /// Three periods of the slowest accelerometer that cameras carry, 63 Hz.
  static constexpr Duration kPatience = Duration::fromMilliseconds(50);
  static constexpr Duration kLongestGap = Duration::fromMilliseconds(50);

  struct Sample {
    Stamp stamp;
    Stamp arrival;
    Eigen::Vector3d value = Eigen::Vector3d::Zero();
  };

  struct Counters {
    std::uint64_t stale = 0;     ///< not newer than the one before of its kind
    std::uint64_t unpaired = 0;  ///< gyro samples without accelerometer samples around them
    std::uint64_t overrun = 0;   ///< more than there is room for
  };

  void addGyro(const Sample& sample) { add(gyro_, sample); }
  void addAccel(const Sample& sample) { add(accel_, sample); }
  /// The next sample that is whole by `now`; false: none. Its stamp is the gyro's, in `host`.
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
