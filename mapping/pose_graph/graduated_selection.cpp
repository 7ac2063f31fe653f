#include "mapping/pose_graph/graduated_selection.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

/// Loops that were left out at the start stay marked by this weight while mu grows.
constexpr double kOut = 0;

double graduatedWeight(double chi_squared, double limit, double mu) {
  if (chi_squared <= mu / (mu + 1) * limit) {
    return 1;
  }
  if (!(chi_squared < (mu + 1) / mu * limit)) {
    return 0;
  }
  return std::sqrt(limit * mu * (mu + 1) / chi_squared) - mu;
}

/// A loop that has reached 0 while mu grows may come back: a tiny weight keeps it apart from those left out.
constexpr double kAlmostOut = 1e-12;

bool decided(std::span<const double> weights) {
  return std::all_of(weights.begin(), weights.end(), [](double w) { return w <= kAlmostOut || w == 1; });
}

/// In or out by the limit; false when nothing changed.
bool settle(double limit, std::span<double> weights, std::span<const double> chi_squared) {
  bool changed = false;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const double weight = chi_squared[k] <= limit ? 1 : 0;
    changed = changed || weight != weights[k];
    weights[k] = weight;
  }
  return changed;
}

}  // namespace

Status selectGraduated(const GraduatedSettings& settings, WeightedLoops& problem, std::span<double> weights,
                       std::span<double> chi_squared, GraduatedReport& report) {
  report = {};
  const double limit = settings.max_chi_squared;
  const auto solve = [&] {
    ++report.solutions;
    return problem.solve(weights, chi_squared);
  };
  if (const Status status = solve(); !status.ok()) {
    return status;
  }
  double worst = 0;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    worst = weights[k] > kOut ? std::max(worst, chi_squared[k]) : worst;
  }
  if (worst > limit) {
    // 2 worst > limit: mu starts above 0 and where the surrogate is convex.
    double mu = limit / (2 * worst - limit);
    while (report.solutions < settings.max_solutions) {
      for (std::size_t k = 0; k < weights.size(); ++k) {
        if (weights[k] > kOut) {
          weights[k] = std::max(graduatedWeight(chi_squared[k], limit, mu), kAlmostOut);
        }
      }
      if (const Status status = solve(); !status.ok()) {
        return status;
      }
      if (decided(weights)) {
        break;
      }
      mu *= settings.growth;
    }
  }
  for (std::uint32_t k = 0; k < settings.max_settling && !report.settled; ++k) {
    if (settle(limit, weights, chi_squared)) {
      if (const Status status = solve(); !status.ok()) {
        return status;
      }
    } else {
      report.settled = true;
    }
  }
  report.kept = static_cast<std::uint32_t>(std::count(weights.begin(), weights.end(), 1.0));
  return okStatus();
}

}  // namespace swiftlet
