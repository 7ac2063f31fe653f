#pragma once
// Makes the stamps that a map hands out strictly rising without holding an error.
//
// A map that has just learnt of a smaller delay says an earlier time than it would have. Where that would not
// rise, the stamp moves on by a quarter of the device's own step instead: the map catches up with the other
// three quarters of each step. Where catching up would take a stamp more than kMostAhead from the truth,
// there is no stamp until the map has passed the last one. O(1).

#include <algorithm>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

class RisingStamps {
 public:
  /// `step`: from the sample before on the device's clock, positive. False: no stamp for this sample.
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
