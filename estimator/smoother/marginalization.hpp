#pragma once
// What leaves the window goes into the prior: columns of one state, and explicit landmarks and planes.
//
// The factors that touch what leaves are linearized once more, with first estimates of everything that they
// touch frozen, expanded at these, and the leaving columns eliminated (elimination.hpp). Equations:
// docs/smoother.md. Memory: 0.1 MiB, reserved by the constructor. Cost: cubic in the columns touched.

#include <array>
#include <cstdint>
#include <vector>

#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/window_problem.hpp"

namespace swiftlet {

/// What goes into the prior at a time: columns [first, first + count) of the state at `position`, and the
/// extra states marked as leaving.
struct Departure {
  std::size_t position = 0;
  int first = 0;
  int count = 0;                    ///< zero: extra states alone
  bool with_motion_factor = false;  ///< to the next state
  bool with_landmarks = false;      ///< that no recent frame sees, and its sightings of explicit ones
};

class Marginalization {
 public:
  Marginalization();

  /// The state itself, and what it saw that did not leave, is removed by the caller; landmarks that left, and
  /// leaving extra states, are gone afterwards. Overwrites the system.
  void marginalize(WindowProblem& problem, NormalEquations& system, const Departure& departure);

 private:
  static constexpr std::uint8_t kNoSlot = 255;

  void involve(WindowProblem& problem, const Departure& departure);
  void involveExtras(const WindowProblem& problem);
  void build(WindowProblem& problem, NormalEquations& system, const Departure& departure);
  void expandAtReferences(const WindowProblem& problem, NormalEquations& system);
  void eliminate(const WindowProblem& problem, NormalEquations& system, const Departure& departure);
  void writePrior(WindowProblem& problem, NormalEquations& system, const Departure& departure) const;
  [[nodiscard]] bool leaves(const WindowProblem& problem, const Landmark& landmark) const;

  std::uint8_t slot_ = kNoSlot;          // of the state that loses columns
  std::uint8_t landmarks_of_ = kNoSlot;  // the same where its landmarks go too
  std::array<bool, kMaxStates + kMaxExtraStates> involved_{};
  std::vector<double> work_;
};

}  // namespace swiftlet
