#pragma once
// Graduated non-convexity: selects loops by how well they agree with all others at once, after pairwise
// consistency.
//
// Minimizes sum over the odometry of chi2 + sum over loops of min(chi2, c2): truncated least squares, with c2
// the largest chi-squared accepted of a true loop. The weights w of the loops start at 1, and the problem
// becomes the truncated one as mu grows:
//   w = 1                                  where chi2 <= mu / (mu + 1) c2
//   w = 0                                  where chi2 >= (mu + 1) / mu c2
//   w = sqrt(c2 mu (mu + 1) / chi2) - mu   between.
// At the end loops within c2 are taken and the rest left out; this is repeated until nothing changes, at most
// `max_settling` times, so that a loop that was left out but fits returns.
//
// The caller solves the graph: begin(), then next() with each solution's chi-squared until it returns false.
// The work can thus be spread over many steps; it takes 20 to 40 solutions, each from the poses of the one
// before. Deterministic. No allocation. Source: Yang, Antonante, Tzoumas, Carlone, "Graduated Non-Convexity
// for Robust Spatial Perception: From Non-Minimal Solvers to Global Outlier Rejection", RA-L 2020, section V;
// the initial mu is their remark 5.

#include <cstdint>
#include <span>

namespace swiftlet {

struct GraduatedSettings {
  double max_chi_squared = 0;        ///< c2; of 3 or 6 degrees of freedom
  double growth = 1.4;               ///< factor on mu per solution, as in the source
  std::uint32_t max_solutions = 60;  ///< while mu grows
  std::uint32_t max_settling = 5;
};

struct GraduatedReport {
  std::uint32_t solutions = 0;
  std::uint32_t kept = 0;  ///< loops with weight 1
  bool settled = false;    ///< the last solution changed no weight
};

class GraduatedSelection {
 public:
  explicit GraduatedSelection(const GraduatedSettings& settings) : settings_(settings) {}

  /// Starts a new problem. The caller makes the first solution with weights of its own: a loop of weight 0
  /// takes part only at the end, if it fits; any other weight lets it take part from the start.
  void begin();
  /// `chi_squared`: unweighted, of each loop at the solution of `weights`. Replaces `weights` by those of the
  /// next solution. False at the end: all weights are 0 or 1 and final.
  bool next(std::span<const double> chi_squared, std::span<double> weights);
  [[nodiscard]] const GraduatedReport& report() const { return report_; }

 private:
  enum class Stage : std::uint8_t { kFirst, kGrowing, kSettling };

  void weigh(std::span<const double> chi_squared, std::span<double> weights) const;

  GraduatedSettings settings_;
  GraduatedReport report_;
  Stage stage_ = Stage::kFirst;
  double mu_ = 0;
  std::uint32_t settlings_ = 0;
};

}  // namespace swiftlet
