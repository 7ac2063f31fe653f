#pragma once
// Status of a clock map or a trigger matcher for `doctor`, reports and health. Plain numbers.

#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class LockState : std::uint8_t {
  kUnlocked,  ///< no estimate: use the arrival or the driver's own stamp
  kLocking,   ///< stamps are available but may be off by the jitter of the delay
  kLocked,    ///< uncertainty is within its limit
};

struct TimesyncStatus {
  LockState lock = LockState::kUnlocked;
  Duration offset;        ///< host - device at the newest sample; trigger: frame stamp - edge
  double skew_ppm = 0;    ///< of the offset; positive: the device's clock runs slow
  Duration uncertainty;   ///< estimated error of the mapped stamp, without the constant delay
  Duration error_bound;   ///< two-way: half the smallest round trip, an upper bound of the error; one-way: 0
  Duration residual_p50;  ///< delay above the smallest; trigger: |frame stamp - expected|
  Duration residual_p99;  ///< the same
  std::uint64_t samples = 0;           ///< samples used
  std::uint64_t resets = 0;            ///< steps of the device's clock; trigger: associations given up
  std::uint64_t refused = 0;           ///< samples or frames that got no stamp here
  std::uint64_t missed_edges = 0;      ///< trigger: pulses that must have occurred but were not read
  std::uint64_t glitch_edges = 0;      ///< trigger: edges where no pulse is possible
  std::uint64_t unmatched_frames = 0;  ///< trigger: frames without an edge while locked
};

}  // namespace swiftlet
