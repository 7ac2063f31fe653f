#pragma once
// Adds the factors of the window to normal equations: prior, motion, rest, explicit landmarks and planes.
//
// For structureless landmarks see NormalEquations::addLandmark. Equations: docs/smoother.md. No allocation.

#include <cstdint>
#include <vector>

#include "estimator/smoother/imu_excess.hpp"
#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/window_problem.hpp"

namespace swiftlet {

/// Adds the prior and returns its cost without the constant. `work`: at least as long as the prior's
/// dimension.
double addPrior(WindowProblem& problem, NormalEquations& system, std::vector<double>& work);

/// Adds the factor between the states at `position` - 1 and `position`, if both have motion, and the rest
/// factor if they are at rest.
void addMotion(const WindowProblem& problem, std::size_t position, NormalEquations& system);

/// Residuals of all motion factors in the window at the current states.
[[nodiscard]] MotionResiduals motionResiduals(const WindowProblem& problem);

/// Adds explicit landmarks, and the factors of planes that are in use.
void addExtras(const WindowProblem& problem, NormalEquations& system);
/// After all factors: adds weak information, and sets the sigmas of explicit landmarks' inverse depths.
void finishExtras(WindowProblem& problem, NormalEquations& system);
/// Adds all factors of the leaving extra states and, unless null, the observations of the other explicit
/// landmarks by the state in the slot.
void addDepartingExtras(const WindowProblem& problem, const std::uint8_t* slot, NormalEquations& system);

/// Costs of the system and of the prior at the current states and points, with cameras placed; no landmark is
/// linearized. `work` as above. Cheaper than building the system.
struct WindowCost {
  double factors = 0;
  double prior = 0;  ///< without its constant
};
[[nodiscard]] WindowCost costOf(WindowProblem& problem, std::vector<double>& work);

}  // namespace swiftlet
