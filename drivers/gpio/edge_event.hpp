#pragma once
// One edge of a GPIO line, and a counter of missed edges.

#include <cstdint>
#include <optional>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class EdgeKind : std::uint8_t { kRising, kFalling, kBoth };

struct EdgeEvent {
  Stamp stamp;  ///< CLOCK_MONOTONIC, from the interrupt handler: 2 to 20 us late, more under load
  bool rising = true;
  std::optional<std::uint32_t> sequence;  ///< event number on this line; empty if the kernel has none
};

/// Counts missed edges: by sequence number if there is one, otherwise by time if the period is known. O(1).
class EdgeGaps {
 public:
  /// `period`: between edges of the selected kind; zero: unknown.
  explicit EdgeGaps(Duration period = {}) : period_(period) {}

  /// Returns the number of edges missed between the previous one and this one.
  std::uint64_t add(const EdgeEvent& event);
  [[nodiscard]] std::uint64_t missed() const { return missed_; }

 private:
  Duration period_;
  bool any_ = false;
  Stamp newest_;
  std::uint32_t sequence_ = 0;  ///< the kernel's count starts at 1: a first edge 3 means two missed
  std::uint64_t missed_ = 0;
};

}  // namespace swiftlet
