#pragma once
// Unwraps sensor counters and clocks of 16 or 32 bits to 64 bits, and counts lost samples from their steps.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// Unwraps a clock: a step of more than half the range forward is a step back, so that a restart of the
/// device is detected. Cost: O(1). `T` is unsigned.
template <typename T>
class WrappingClock {
 public:
  std::int64_t unwrap(T value) {
    total_ = last_ ? total_ + difference(value, *last_) : static_cast<std::int64_t>(value);
    last_ = value;
    return total_;
  }
  /// Unwraps a value close to the last one without changing the state, for events reported next to a sample.
  [[nodiscard]] std::int64_t near(T value) const {
    return last_ ? total_ + difference(value, *last_) : static_cast<std::int64_t>(value);
  }
  void forget() { last_.reset(); }

 private:
  static std::int64_t difference(T value, T from) {
    const auto forward = static_cast<T>(value - from);
    const auto backward = static_cast<T>(from - value);
    return forward <= backward ? static_cast<std::int64_t>(forward) : -static_cast<std::int64_t>(backward);
  }

  std::optional<T> last_;
  std::int64_t total_ = 0;
};

/// Unwraps a counter: never goes backwards, so that no number is used twice.
template <typename T>
class WrappingCounter {
 public:
  std::uint64_t unwrap(T value) {
    total_ = last_ ? total_ + static_cast<T>(value - *last_) : value;
    last_ = value;
    return total_;
  }
  void forget() { last_.reset(); }

 private:
  std::optional<T> last_;
  std::uint64_t total_ = 0;
};

/// Number of samples missing before each sample: from the counter if there is one, otherwise from the
/// device's clock and the median of its last steps. Memory: nine steps. Cost: O(1).
class SampleGaps {
 public:
  struct Step {
    std::uint64_t missing = 0;
    bool went_back = false;  ///< the clock went back, or the counter by less than 2^15 (as 16 bits)
  };
  Step step(std::optional<Stamp> device, std::optional<std::uint64_t> counter);
  /// Median of the clock's last nine steps; empty if there were fewer, or if there is a counter.
  [[nodiscard]] std::optional<Duration> usualStep() const;
  void forget();

 private:
  std::uint64_t missingByClock(Duration step);

  static constexpr std::size_t kSteps = 9;
  std::array<std::int64_t, kSteps> steps_ = {};  ///< [ns], ring of the last steps
  std::size_t step_count_ = 0;
  std::optional<Stamp> device_;
  std::optional<std::uint64_t> counter_;
};

/// `value` units of `ns_per_unit` as a stamp; empty if it exceeds 63 bits of nanoseconds (292 years).
std::optional<Stamp> stampOf(std::uint64_t value, std::uint64_t ns_per_unit);

}  // namespace swiftlet
