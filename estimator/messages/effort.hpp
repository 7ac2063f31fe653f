#pragma once
// The work that stages may spend on one frame. Work is data: a stage never reads a clock; a schedule lowers
// these numbers under overload and records them so that the run can be repeated.

#include "estimator/core/limits.hpp"

namespace swiftlet {

struct Effort {
  int iterations = 2;  ///< Gauss-Newton steps of the smoother
  /// Largest number of features tracked (settings may ask for fewer), and of a frame's tracks used by the
  /// smoother.
  int features = static_cast<int>(kMaxFeatures);
  int keyframes = 12;  ///< keyframes that the smoother's window keeps

  bool operator==(const Effort&) const = default;
};

}  // namespace swiftlet
