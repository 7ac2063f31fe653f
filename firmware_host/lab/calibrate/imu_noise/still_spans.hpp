#pragma once
// Where a log of hours stands still.
//
// The log is cut into blocks of one second. A block moves where its readings scatter more than those of the
// quietest quarter of the blocks, or where its mean is off that of the block before by more than theirs. The
// neighbours of a moving block are left out with it.
// Memory: 136 bytes a block, 0.5 MB an hour.

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
  /// After the last sample.
  void finish();

  /// Whether the samples of this stamp are to be used.
  [[nodiscard]] bool still(Stamp stamp) const;
  [[nodiscard]] double seconds() const { return (last_ - first_).seconds(); }
  [[nodiscard]] double movingSeconds() const;
  /// "12 to 15 s: gyro y, 30 times the scatter at rest", in order, at most `most` and how many more.
  [[nodiscard]] std::vector<std::string> motions(std::size_t most) const;
  /// Why even the quietest quarter is no rest, in words; empty: it is one.
  [[nodiscard]] std::string restless() const;

 private:
  static constexpr std::size_t kParts = 10;  // of a block, for its slow scatter

  struct Block {
    double count = 0;  // 0: no samples
    ImuSix mean = ImuSix::Zero();
    ImuSix deviation = ImuSix::Zero();
    float slow_gyro = 0;  // scatter of the parts' means, RMS of the axes
    float slow_accel = 0;
    float times = 0;  // the most that it shows over what rest does
    int axis = -1;    // where that is; -1: it stands
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
