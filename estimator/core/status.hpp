#pragma once
// Faults as values. A stage never throws or aborts: it returns a `Status`, which the host turns into a
// counted event. A Status is two words; `what` points to a literal.

#include <cstdint>

namespace swiftlet {

enum class StatusCode : std::uint8_t {
  kOk,
  kNotReady,         ///< more input is needed (start-up, an empty queue)
  kInvalidInput,     ///< the message was refused: NaN, wrong size, repeated or reversed stamp
  kCapacityReached,  ///< a fixed capacity was full; its policy was applied
  kDegenerate,       ///< the data do not determine the result (no parallax, too few points)
  kNumerical,        ///< a factorization or an iteration failed
  kFailed,           ///< the stage cannot continue without a reset
};

struct Status {
  StatusCode code = StatusCode::kOk;
  const char* what = "";  ///< literal text: names the condition and the remedy

  [[nodiscard]] constexpr bool ok() const { return code == StatusCode::kOk; }
};

constexpr Status okStatus() { return {}; }

}  // namespace swiftlet
