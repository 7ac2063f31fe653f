#pragma once
// One edge of a GPIO line, and the count of those that never came.

#include <cstdint>
#include <optional>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class EdgeKind : std::uint8_t { kRising, kFalling, kBoth };

struct EdgeEvent {
  Stamp stamp;  ///< CLOCK_MONOTONIC, taken in the interrupt handler: 2 to 20 us late, more under load
  bool rising = true;
  std::optional<std::uint32_t> sequence;  ///< of this line's events; empty where the kernel has none
};

/// Counts missed edges: by sequence where there is one, else by time when the period is known. O(1).
class EdgeGaps {
 public:
  /// `period` between edges of the kind that is read; zero: not known.
  explicit EdgeGaps(Duration period = {}) : period_(period) {}

  /// Edges that lack between the one before and this one.
  std::uint64_t add(const EdgeEvent& event);
  [[nodiscard]] std::uint64_t missed() const { return missed_; }

 private:
  Duration period_;
  bool any_ = false;
  Stamp newest_;
  std::uint32_t sequence_ = 0;  ///< the kernel's count begins at 1: a first edge of 3 has two before it
  std::uint64_t missed_ = 0;
};

}  // namespace swiftlet
