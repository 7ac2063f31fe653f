#pragma once
// Makes the stamps of a clock map strictly rising without a lasting error.
//
// When the map learns a smaller delay, its next stamp can be earlier than the last one. Then the stamp
// advances by a quarter of the device's own step instead, so three quarters of each step are caught up. If a
// stamp would be more than kMostAhead later than the map, there is no stamp until the map has passed the last
// one. O(1).

#include <algorithm>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

class RisingStamps {
 public:
  /// `step`: time since the previous sample on the device's clock, positive. False: no stamp for this sample.
  [[nodiscard]] bool next(Stamp mapped, Duration step, Stamp& out) {
    if (any_ && mapped <= last_) {
      if (last_ - mapped > kMostAhead) return false;
      const std::int64_t quarter = step.ns / 4;
      mapped = last_ + Duration{std::clamp<std::int64_t>(quarter, 1, kMostAhead.ns)};
    }
    any_ = true;
    last_ = mapped;
    out = mapped;
    return true;
  }

 private:
  static constexpr Duration kMostAhead = {20'000'000};
  Stamp last_;
  bool any_ = false;
};

}  // namespace swiftlet
