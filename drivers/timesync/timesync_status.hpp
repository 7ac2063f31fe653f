#pragma once
// What a clock map or a trigger matcher says of itself, for `doctor`, reports and health. Plain numbers.

#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class LockState : std::uint8_t {
  kUnlocked,  ///< nothing to go by: use the arrival's or the driver's own stamp
  kLocking,   ///< stamps are available, but may be off by the delay's jitter
  kLocked,    ///< uncertainty within its limit
};

struct TimesyncStatus {
  LockState lock = LockState::kUnlocked;
  Duration offset;            ///< host - device at the newest sample; trigger: frame stamp - edge
  double skew_ppm = 0;        ///< of the offset; positive: the device's clock runs slow
  Duration uncertainty;       ///< estimated error of the mapped stamp beyond the constant delay
  Duration error_bound;       ///< two-way: half the smallest round trip, which no error exceeds; one-way: 0
  Duration residual_p50;      ///< delay above the smallest; trigger: |frame stamp - expected|
  Duration residual_p99;      ///< the same
  std::uint64_t samples = 0;  ///< that were used
  std::uint64_t resets = 0;   ///< steps of the device's clock; trigger: associations given up
  std::uint64_t refused = 0;  ///< samples or frames without a stamp from here
  std::uint64_t missed_edges = 0;      ///< trigger: pulses that must have been and were not read
  std::uint64_t glitch_edges = 0;      ///< trigger: edges where no pulse can have been
  std::uint64_t unmatched_frames = 0;  ///< trigger: frames while locked that got no edge
};

}  // namespace swiftlet
