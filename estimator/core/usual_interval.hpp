#pragma once
// The usual time from one image to the next, learned from the stamps: the shortest of late. After a change of
// the rate it follows within a few images; lost images do not make it longer for long.

#include <algorithm>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

class UsualInterval {
 public:
  /// At the lowest frame rate that can be set (1 Hz); the usual interval before any was seen.
  static constexpr Duration kLongest = Duration::fromMilliseconds(1000);

  void add(Duration interval) { usual_ = std::min({interval, usual_ + usual_, kLongest}); }
  [[nodiscard]] Duration get() const { return usual_; }

 private:
  Duration usual_ = kLongest;
};

}  // namespace swiftlet
