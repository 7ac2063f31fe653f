#pragma once
// The raw IMU samples of the window, kept so that increments can be integrated again after a change of bias,
// or over two intervals when the state between them leaves. Contiguous in time (a sliding array, compacted
// when its end is reached). When full, the oldest samples are dropped. Memory: twice `capacity` samples of 56
// bytes, reserved by the constructor.

#include <Eigen/Core>
#include <algorithm>
#include <span>
#include <vector>

#include "estimator/imu/scan_turn.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet {

class ImuBuffer {
 public:
  explicit ImuBuffer(std::size_t capacity) : samples_(2 * capacity), capacity_(capacity) {}

  void clear() { begin_ = end_ = 0; }
  [[nodiscard]] bool empty() const { return begin_ == end_; }
  /// Call only if the buffer is not empty.
  [[nodiscard]] const ImuSample& newest() const { return samples_[end_ - 1]; }

  /// Appends; the stamp must be later than the newest's. Amortized O(1).
  void push(const ImuSample& sample) {
    if (end_ == samples_.size()) {
      std::copy(samples_.begin() + static_cast<std::ptrdiff_t>(end_ - capacity_), samples_.end(),
                samples_.begin());
      begin_ = 0;
      end_ = capacity_;
    }
    samples_[end_++] = sample;
    begin_ = std::max(begin_, end_ > capacity_ ? end_ - capacity_ : 0);
  }

  /// The samples needed to integrate over [from, to]: those inside and one neighbour on each side, if they
  /// are still kept. Valid until the next push. O(log size).
  [[nodiscard]] std::span<const ImuSample> around(Stamp from, Stamp to) const {
    const auto first = samples_.begin() + static_cast<std::ptrdiff_t>(begin_);
    const auto last = samples_.begin() + static_cast<std::ptrdiff_t>(end_);
    const auto before = [](const ImuSample& s, Stamp t) { return s.stamp < t; };
    auto low = std::lower_bound(first, last, from, before);
    auto high = std::lower_bound(low, last, to, before);
    if (low != first && (low == last || low->stamp > from)) --low;
    if (high != last) ++high;
    return {&*low, static_cast<std::size_t>(high - low)};
  }

  /// Rotation during the rows of an image whose middle row was read at `middle`, as far as samples are
  /// available; zero without samples.
  [[nodiscard]] ScanTurn scanTurnAt(Stamp middle, Duration readout, const Eigen::Vector3d& bias_gyro,
                                    const GyroIntrinsics& intrinsics) const {
    if (empty() || readout.ns == 0) return {};
    return scanTurn(around(middle - readout, middle + readout), middle, readout, bias_gyro, intrinsics);
  }

 private:
  std::vector<ImuSample> samples_;
  std::size_t capacity_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
};

}  // namespace swiftlet
