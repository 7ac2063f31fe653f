#pragma once
// The factors of the window, put into normal equations: prior, motion, rest, explicit landmarks and planes.
//
// Structureless landmarks are NormalEquations::addLandmark. Equations: docs/smoother.md. Nothing is
// allocated.

#include <cstdint>
#include <vector>

#include "estimator/smoother/imu_excess.hpp"
#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/window_problem.hpp"

namespace swiftlet {

/// Returns the prior's cost, without its constant. `work`: at least as long as the prior's dimension.
double addPrior(WindowProblem& problem, NormalEquations& system, std::vector<double>& work);

/// Between the states at `position` - 1 and `position`, where both have motion, with rest where there is.
void addMotion(const WindowProblem& problem, std::size_t position, NormalEquations& system);

/// Of all motion in the window, with the states as they are.
[[nodiscard]] MotionResiduals motionResiduals(const WindowProblem& problem);

/// Explicit landmarks, and planes that count.
void addExtras(const WindowProblem& problem, NormalEquations& system);
/// After all factors: weak information, and sigmas of explicit landmarks' inverse depths.
void finishExtras(WindowProblem& problem, NormalEquations& system);
/// All that the leaving extra states take part in, and, unless null, what the state in the slot saw of the
/// others.
void addDepartingExtras(const WindowProblem& problem, const std::uint8_t* slot, NormalEquations& system);

/// What the system's cost and the prior's would be at the states and points as they are, cameras placed;
/// no landmark is linearized. `work` as above. Cost: less than building the system.
struct WindowCost {
  double factors = 0;
  double prior = 0;  ///< without its constant
};
[[nodiscard]] WindowCost costOf(WindowProblem& problem, std::vector<double>& work);

}  // namespace swiftlet
