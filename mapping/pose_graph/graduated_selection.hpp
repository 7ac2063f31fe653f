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
// The caller solves: begin(), then next() with each solution's chi-squared until it returns false. So the
// work can be spread over as many steps as the caller likes; 20 to 40 solutions, each from the poses of the
// one before. Deterministic. No allocation. Source: Yang, Antonante, Tzoumas, Carlone, "Graduated
// Non-Convexity for Robust Spatial Perception: From Non-Minimal Solvers to Global Outlier Rejection", RA-L
// 2020, section V; mu's start is their remark 5.

#include <cstdint>
#include <span>

namespace swiftlet {

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

class GraduatedSelection {
 public:
  explicit GraduatedSelection(const GraduatedSettings& settings) : settings_(settings) {}

  /// A new problem. Its first solution is the caller's, with its own weights: 0 leaves a loop out until the
  /// end (it may still come back when it fits), anything above lets it take part from the start.
  void begin();
  /// `chi_squared`: each loop's, unweighted, at the solution of `weights`, which become those of the next
  /// solution. False: they have not changed or may not any more, and are 0 or 1.
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
