#pragma once
// What the stages may spend on one frame. Work is data: a stage never looks at a clock, an executor lowers
// these numbers when time runs short, and records what it gave so that the run can be repeated.

#include "estimator/core/limits.hpp"

namespace swiftlet {

struct Effort {
  int iterations = 2;  ///< Gauss-Newton steps of the smoother
  /// Features tracked (the settings may ask for fewer), and of a frame's tracks taken into the smoother.
  int features = static_cast<int>(kMaxFeatures);
  int keyframes = 12;  ///< keyframes that the smoother's window keeps

  bool operator==(const Effort&) const = default;
};

}  // namespace swiftlet
