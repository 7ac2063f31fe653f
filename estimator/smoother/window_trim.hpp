#pragma once
// Removes states from the window.
//
// A frame between two keyframes loses its observations, and its two IMU intervals are merged. An old keyframe
// loses velocity and biases, later its pose, into the prior (marginalization.hpp). keyframe_choice.hpp
// selects the keyframe. Sources: Leutenegger et al., IJRR 2015; Usenko et al., RA-L 2020. Construct it for
// each call.

#include "estimator/core/fixed_vector.hpp"
#include "estimator/smoother/marginalization.hpp"
#include "estimator/smoother/window_covariance.hpp"

namespace swiftlet {

struct TrimLimits {
  std::size_t recent = 0;            ///< newest frames that keep all variables
  std::size_t motion_keyframes = 0;  ///< states before them with velocity and biases
  std::size_t keyframes = 0;         ///< including pose-only ones
  double horizon = 0;                ///< s
};

class WindowTrim {
 public:
  WindowTrim(WindowProblem& problem, NormalEquations& system, WindowCovariance& covariance,
             Marginalization& marginalization)
      : problem_(problem), system_(system), covariance_(covariance), marginalization_(marginalization) {}

  /// Removes states and appends the keyframes that left to `left_window`.
  void trim(const TrimLimits& limits, FixedVector<KeyframeState, kMaxStates>& left_window);

 private:
  void dropFrame(std::size_t position);
  void dropMotion(std::size_t position);
  void dropKeyframe(std::size_t position);
  [[nodiscard]] std::size_t chooseKeyframe(std::size_t candidates) const;

  WindowProblem& problem_;
  NormalEquations& system_;
  WindowCovariance& covariance_;
  Marginalization& marginalization_;
};

}  // namespace swiftlet
