#pragma once
// Gauss-Newton over the window: linearizes all factors, eliminates landmarks, and steps until the step is
// small.
//
// Points move with the step (back-substitution); a step that increases the cost is undone; observations and
// landmarks that do not fit are removed by named limits. No allocation after the constructor. Memory: 2.6
// MiB. Cost: docs/smoother.md.

#include <vector>

#include "estimator/core/status.hpp"
#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/window_covariance.hpp"
#include "estimator/smoother/window_factors.hpp"
#include "estimator/smoother/window_problem.hpp"

namespace swiftlet {

class WindowSolver {
 public:
  WindowSolver();

  /// `pose_tolerance`: m, rad; stops after a step in which no pose moves further. `statistics` receives
  /// iterations and the IMU residual. kFailed if the system cannot be solved.
  Status solve(WindowProblem& problem, NormalEquations& system, WindowCovariance& covariance, int iterations,
               double pose_tolerance, FrameStatistics& statistics);

  /// Median of the squared norms of the newest state's residuals in the last solve, in sigmas, before
  /// rejections; 0 if there are too few.
  [[nodiscard]] double medianSquare() const { return median_square_; }

 private:
  void reintegrate(WindowProblem& problem) const;
  void triangulateAll(WindowProblem& problem, int iterations) const;
  /// `first`: for the first step of a solve, also sets the sigmas of points, with the states of the last
  /// solve.
  void build(WindowProblem& problem, NormalEquations& system, bool first);
  void substitutePoints(WindowProblem& problem, const VectorMap& step) const;
  void takeBack(WindowProblem& problem) const;
  double medianOfNewest(const WindowProblem& problem);

  std::vector<EliminatedPoint> eliminated_;  // by landmark
  std::vector<double> squares_;              // scratch of medianOfNewest()
  double median_square_ = 0;
  std::vector<double> step_;
  WindowCost cost_;  // at the point where the system was last built
};

/// Removes observations of the newest state with residuals above `sigmas`; a landmark that loses them
/// kMaxRejections times is removed.
void rejectNewestSightings(WindowProblem& problem, double sigmas);
/// Removes landmarks whose mean residual was above `sigmas` kMaxRejections times.
void rejectLandmarks(WindowProblem& problem, double sigmas);

}  // namespace swiftlet
