#pragma once
// Finds the parts of a long log in which the sensor is at rest.
//
// The log is cut into blocks of one second. A block moves if its readings scatter more than those of the
// quietest quarter of the blocks, or if its mean differs from that of the previous block by more than theirs.
// The neighbours of a moving block are excluded with it. Memory: 136 bytes per block, 0.5 MB per hour.

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "estimator/core/stamp.hpp"
#include "firmware_host/lab/calibrate/imu_noise/allan_variance.hpp"

namespace swiftlet {

class StillSpans {
 public:
  void add(Stamp stamp, const ImuSix& reading);
  /// Call after the last sample.
  void finish();

  /// Whether samples at this stamp are at rest.
  [[nodiscard]] bool still(Stamp stamp) const;
  [[nodiscard]] double seconds() const { return (last_ - first_).seconds(); }
  [[nodiscard]] double movingSeconds() const;
  /// "12 to 15 s: gyro y, 30 times the scatter at rest", in order: at most `most` lines, and how many more
  /// there are.
  [[nodiscard]] std::vector<std::string> motions(std::size_t most) const;
  /// Why even the quietest quarter is not at rest, as text; empty: it is.
  [[nodiscard]] std::string restless() const;

 private:
  static constexpr std::size_t kParts = 10;  // per block, for its slow scatter

  struct Block {
    double count = 0;  // 0: no samples
    ImuSix mean = ImuSix::Zero();
    ImuSix deviation = ImuSix::Zero();
    float slow_gyro = 0;  // scatter of the parts' means, RMS of the axes
    float slow_accel = 0;
    float times = 0;  // largest ratio to the value at rest
    int axis = -1;    // axis of that ratio; -1: at rest
    bool used = true;
  };
  struct Sums {
    double count = 0;
    ImuSix sum = ImuSix::Zero();
    ImuSix squares = ImuSix::Zero();
  };
  void close();

  bool any_ = false;
  Stamp first_;
  Stamp last_;
  ImuSix reference_ = ImuSix::Zero();
  std::array<Sums, kParts> open_{};
  std::vector<Block> blocks_;
  ImuSix quiet_ = ImuSix::Zero();  // deviation of the quietest quarter
};

}  // namespace swiftlet
