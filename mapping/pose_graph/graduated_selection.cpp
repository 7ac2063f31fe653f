#include "mapping/pose_graph/graduated_selection.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

/// Weight of loops that were left out at the start; it stays while mu grows.
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

/// Weight of loops that reach 0 while mu grows. They may return before it ends, unlike those left out at the
/// start.
constexpr double kAlmostOut = 1e-12;

bool decided(std::span<const double> weights) {
  return std::all_of(weights.begin(), weights.end(), [](double w) { return w <= kAlmostOut || w == 1; });
}

/// Sets each weight to 1 or 0 by the limit. False if nothing changed.
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

void GraduatedSelection::begin() {
  report_ = {};
  stage_ = Stage::kFirst;
  settlings_ = 0;
}

void GraduatedSelection::weigh(std::span<const double> chi_squared, std::span<double> weights) const {
  for (std::size_t k = 0; k < weights.size(); ++k) {
    if (weights[k] == kOut) continue;
    weights[k] = std::max(graduatedWeight(chi_squared[k], settings_.max_chi_squared, mu_), kAlmostOut);
  }
}

bool GraduatedSelection::next(std::span<const double> chi_squared, std::span<double> weights) {
  ++report_.solutions;
  const double limit = settings_.max_chi_squared;
  if (stage_ == Stage::kFirst) {
    double worst = 0;
    for (std::size_t k = 0; k < weights.size(); ++k) {
      if (weights[k] > kOut) worst = std::max(worst, chi_squared[k]);
    }
    stage_ = worst > limit ? Stage::kGrowing : Stage::kSettling;
    // If worst > limit, mu is above 0, and the surrogate is convex there; otherwise mu is not used.
    mu_ = limit / (2 * worst - limit);
  } else if (stage_ == Stage::kGrowing) {
    mu_ *= settings_.growth;
    if (decided(weights) || report_.solutions >= settings_.max_solutions) stage_ = Stage::kSettling;
  }
  if (stage_ == Stage::kGrowing) {
    weigh(chi_squared, weights);
    return true;
  }
  const bool may = settlings_ < settings_.max_settling;
  const bool changed = may && settle(limit, weights, chi_squared);
  settlings_ += changed ? 1 : 0;
  report_.settled = may && !changed;
  report_.kept = static_cast<std::uint32_t>(std::count(weights.begin(), weights.end(), 1.0));
  return changed;
}

}  // namespace swiftlet
