#pragma once
// The usual interval between images, learned from their stamps as the shortest recent one. It follows a
// change of the rate within a few images; lost images increase it only for a short time.

#include <algorithm>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

class UsualInterval {
 public:
  /// Interval at the lowest frame rate that can be set (1 Hz); used before any interval was seen.
  static constexpr Duration kLongest = Duration::fromMilliseconds(1000);

  void add(Duration interval) { usual_ = std::min({interval, usual_ + usual_, kLongest}); }
  [[nodiscard]] Duration get() const { return usual_; }

 private:
  Duration usual_ = kLongest;
};

}  // namespace swiftlet
