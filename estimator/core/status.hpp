#pragma once
// Faults as values. A stage never throws and never aborts: it returns a `Status`, and the host
// turns it into a counted event. Copying one costs two words; `what` points to a literal.

#include <cstdint>

namespace swiftlet {

enum class StatusCode : std::uint8_t {
  kOk,
  kNotReady,         ///< more input is needed (start-up, an empty queue)
  kInvalidInput,     ///< the message was refused: NaN, wrong size, repeated or reversed stamp
  kCapacityReached,  ///< a fixed capacity was full and its policy was applied
  kDegenerate,       ///< the data do not determine the answer (no parallax, too few points)
  kNumerical,        ///< a factorization or an iteration failed
  kFailed,           ///< the stage cannot go on without a reset
};

struct Status {
  StatusCode code = StatusCode::kOk;
  const char* what = "";  ///< literal text: names the condition and the remedy

  [[nodiscard]] constexpr bool ok() const { return code == StatusCode::kOk; }
};

constexpr Status okStatus() { return {}; }

}  // namespace swiftlet
