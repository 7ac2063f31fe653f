#pragma once
// Which states leave the window, when, and how.
//
// A frame between two keyframes gives up its vision and merges its two IMU intervals; an old keyframe loses
// velocity and biases, later its pose, into the prior (marginalization.hpp). Which keyframe:
// keyframe_choice.hpp. Sources: Leutenegger et al., IJRR 2015; Usenko et al., RA-L 2020. Lives for one call.

#include "estimator/core/fixed_vector.hpp"
#include "estimator/smoother/marginalization.hpp"
#include "estimator/smoother/window_covariance.hpp"

namespace swiftlet {

struct TrimLimits {
  std::size_t recent = 0;            ///< newest frames that stay whole
  std::size_t motion_keyframes = 0;  ///< behind them with velocity and biases
  std::size_t keyframes = 0;         ///< these and the pose-only ones
  double horizon = 0;                ///< s
};

class WindowTrim {
 public:
  WindowTrim(WindowProblem& problem, NormalEquations& system, WindowCovariance& covariance,
             Marginalization& marginalization)
      : problem_(problem), system_(system), covariance_(covariance), marginalization_(marginalization) {}

  /// Keyframes that left are appended.
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
