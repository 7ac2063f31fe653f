#pragma once
// Graduated non-convexity: loops weighted by how well they agree with all others at once, the alternative to
// (or the last word after) pairwise consistency.
//
// Minimizes sum over the odometry of chi2 + sum over loops of min(chi2, c2) (truncated least squares, c2: the
// largest chi-squared that a true loop is believed to have): weights w of the loops start at 1 and the
// problem becomes the truncated one as mu grows:
//   w = 1                                  where chi2 <= mu / (mu + 1) c2
//   w = 0                                  where chi2 >= (mu + 1) / mu c2
//   w = sqrt(c2 mu (mu + 1) / chi2) - mu   between.
// At the end loops are in or out: those within c2 are taken, the rest left out, and this is repeated until it
// changes nothing (or `max_settling` times): a loop that was left out but fits comes back.
//
// The solver behind it is the caller's. Cost: as many solutions as `Report::solutions` says, 20 to 40, each
// from the poses of the one before. Deterministic when the solver is. No allocation.
// Source: Yang, Antonante, Tzoumas, Carlone, "Graduated Non-Convexity for Robust Spatial Perception: From
// Non-Minimal Solvers to Global Outlier Rejection", RA-L 2020, section V; mu's start is their remark 5.

#include <cstdint>
#include <span>

#include "estimator/core/status.hpp"

namespace swiftlet {

/// The least-squares problem with weights on its loops.
class WeightedLoops {
 public:
  virtual ~WeightedLoops() = default;
  /// Solves with `weights` (in [0, 1], one a loop) and gives each loop's chi-squared, unweighted, there.
  virtual Status solve(std::span<const double> weights, std::span<double> chi_squared) = 0;
};

struct GraduatedSettings {
  double max_chi_squared = 0;        ///< c2; of 3 or 6 degrees of freedom
  double growth = 1.4;               ///< of mu, a solution; 1.4 as in the source
  std::uint32_t max_solutions = 60;  ///< while mu grows
  std::uint32_t max_settling = 5;
};

struct GraduatedReport {
  std::uint32_t solutions = 0;
  std::uint32_t kept = 0;  ///< loops with weight 1
  bool settled = false;    ///< the last solution changed no weight
};

/// `weights` in: 0 leaves a loop out until the end (it may still come back when it fits), anything above lets
/// it take part from the start; out: 0 or 1. `chi_squared` out: at the last solution. Both as long as there
/// are loops. Returns the solver's status when it fails: `weights` are then those of its last call.
Status selectGraduated(const GraduatedSettings& settings, WeightedLoops& problem, std::span<double> weights,
                       std::span<double> chi_squared, GraduatedReport& report);

}  // namespace swiftlet
