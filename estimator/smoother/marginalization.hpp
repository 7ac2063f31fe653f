#pragma once
// Marginalizes columns of one state, and explicit landmarks and planes, into the prior.
//
// The factors of leaving columns are linearized once more at the current values, which become the prior's
// reference, and the leaving columns are eliminated (elimination.hpp). Equations: docs/smoother.md. Memory:
// 0.1 MiB, reserved by the constructor. Cost: cubic in the columns involved.

#include <array>
#include <cstdint>
#include <vector>

#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/window_problem.hpp"

namespace swiftlet {

/// One marginalization: columns [first, first + count) of the state at `position`, and the extra states
/// marked as leaving.
struct Departure {
  std::size_t position = 0;
  int first = 0;
  int count = 0;                    ///< zero: only extra states
  bool with_motion_factor = false;  ///< includes the motion factor to the next state
  bool with_landmarks = false;      ///< unseen by recent frames, and observations of explicit ones
};

class Marginalization {
 public:
  Marginalization();

  /// Removes the landmarks and extra states that left. The caller removes the state itself and its
  /// observations of landmarks that did not leave. Overwrites the system.
  void marginalize(WindowProblem& problem, NormalEquations& system, const Departure& departure);

 private:
  static constexpr std::uint8_t kNoSlot = 255;

  void involve(WindowProblem& problem, const Departure& departure);
  void involveExtras(const WindowProblem& problem);
  void build(WindowProblem& problem, NormalEquations& system, const Departure& departure);
  void eliminate(const WindowProblem& problem, NormalEquations& system, const Departure& departure);
  void writePrior(WindowProblem& problem, NormalEquations& system, const Departure& departure) const;
  [[nodiscard]] bool leaves(const WindowProblem& problem, const Landmark& landmark) const;

  std::uint8_t slot_ = kNoSlot;          // of the state that loses columns
  std::uint8_t landmarks_of_ = kNoSlot;  // the same, if landmarks leave with it
  std::array<bool, kMaxStates + kMaxExtraStates> involved_{};
  std::vector<double> work_;
};

}  // namespace swiftlet
