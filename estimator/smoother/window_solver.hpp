#pragma once
// Gauss-Newton over the window: all factors linearized, landmarks eliminated, one step, until it is small.
//
// Points move with the step (back-substitution); a step that raises the cost is taken back; sightings and
// landmarks that do not fit are left out by named limits. Nothing is allocated after the constructor. Memory:
// 2.6 MiB. Cost: docs/smoother.md.

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

  /// `pose_tolerance`: m, rad; a step in which no pose moves further is the last. `statistics` gets
  /// iterations and the IMU's residual. kFailed when the system cannot be solved.
  Status solve(WindowProblem& problem, NormalEquations& system, WindowCovariance& covariance, int iterations,
               double pose_tolerance, FrameStatistics& statistics);

  /// Of the last solve: median of the squared norms of the newest state's residuals, in sigmas, before any
  /// was rejected; 0: too few.
  [[nodiscard]] double medianSquare() const { return median_square_; }

 private:
  void reintegrate(WindowProblem& problem) const;
  void triangulateAll(WindowProblem& problem, int iterations) const;
  /// `first` of a solve: points get their sigmas, with the states where the last solve left them.
  void build(WindowProblem& problem, NormalEquations& system, bool first);
  void substitutePoints(WindowProblem& problem, const VectorMap& step) const;
  void takeBack(WindowProblem& problem) const;
  double medianOfNewest(const WindowProblem& problem);

  std::vector<EliminatedPoint> eliminated_;  // by landmark
  std::vector<double> squares_;              // scratch of medianOfNewest()
  double median_square_ = 0;
  std::vector<double> step_;
  WindowCost cost_;  // where the system was last built
};

/// Takes out sightings of the newest state that are further than `sigmas` off; a landmark that loses them
/// kMaxRejections times goes.
void rejectNewestSightings(WindowProblem& problem, double sigmas);
/// Takes out landmarks whose sightings are further than `sigmas` off on the mean, kMaxRejections times.
void rejectLandmarks(WindowProblem& problem, double sigmas);

}  // namespace swiftlet
