#include "mapping/pose_graph/graduated_selection.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

/// Solves until nothing changes; what was asked for, solution by solution.
template <typename Problem>
GraduatedReport run(const GraduatedSettings& settings, const Problem& problem, std::span<double> weights,
                    std::vector<std::vector<double>>* asked = nullptr) {
  std::vector<double> chi_squared(weights.size());
  GraduatedSelection selection(settings);
  selection.begin();
  do {
    if (asked != nullptr) asked->emplace_back(weights.begin(), weights.end());
    problem.solve(weights, chi_squared);
  } while (selection.next(chi_squared, weights));
  return selection.report();
}

/// A mean of measured points of the plane, as many true as said; the smallest problem with the same form.
class Mean {
 public:
  Mean(int count, int true_count, Random& random) {
    for (int k = 0; k < count; ++k) {
      const bool good = k < true_count;
      x_.push_back(good ? 3 + random.normal() : random.uniform(-100, 300));
      y_.push_back(good ? 5 + random.normal() : random.uniform(-100, 300));
    }
  }
  void solve(std::span<const double> weights, std::span<double> chi_squared) const {
    double sum = 0;
    double x = 0;
    double y = 0;
    for (std::size_t k = 0; k < weights.size(); ++k) {
      sum += weights[k];
      x += weights[k] * x_[k];
      y += weights[k] * y_[k];
    }
    sum = std::max(sum, 1e-9);
    for (std::size_t k = 0; k < weights.size(); ++k) {
      chi_squared[k] = (x_[k] - x / sum) * (x_[k] - x / sum) + (y_[k] - y / sum) * (y_[k] - y / sum);
    }
  }

 private:
  std::vector<double> x_, y_;
};

TEST_CASE("Graduated weights keep the true measurements of up to seven in ten false", "[pose_graph]") {
  Random random(4);
  for (const int count : {20, 40, 66}) {
    Mean mean(count, 20, random);
    std::vector<double> weights(static_cast<std::size_t>(count), 1.0);
    GraduatedSettings settings;
    settings.max_chi_squared = 20;
    const GraduatedReport report = run(settings, mean, weights);
    CHECK(report.settled);
    CHECK(report.solutions <= settings.max_solutions + settings.max_settling + 1);
    for (std::size_t k = 0; k < weights.size(); ++k) {
      CAPTURE(count, k);
      CHECK(weights[k] == (k < 20 ? 1.0 : 0.0));
    }
    CHECK(report.kept == 20);
  }
}

TEST_CASE("A measurement left out at the start comes back when it fits", "[pose_graph]") {
  Random random(4);
  Mean mean(20, 20, random);
  std::vector<double> weights(20, 1.0);
  weights[7] = 0;
  GraduatedSettings settings;
  settings.max_chi_squared = 20;
  const GraduatedReport report = run(settings, mean, weights);
  CHECK(report.kept == 20);
  CHECK(report.settled);
  CHECK(report.solutions == 2);
}

/// Loops whose chi-squared no weight changes.
struct Unmoved {
  std::vector<double> given;
  void solve(std::span<const double> /*weights*/, std::span<double> chi_squared) const {
    std::copy(given.begin(), given.end(), chi_squared.begin());
  }
};

TEST_CASE("Weights minimize the surrogate of the truncated cost, below the limit and above", "[pose_graph]") {
  constexpr double kLimit = 20;
  std::vector<double> given;
  for (double value = 1; value <= 60; value += 1) given.push_back(value);
  std::vector<double> weights(given.size(), 1.0);
  GraduatedSettings settings;
  settings.max_chi_squared = kLimit;
  std::vector<std::vector<double>> asked;
  run(settings, Unmoved{given}, weights, &asked);
  REQUIRE(asked.size() > 3);
  // The source's remark 5, and its table of penalties: w chi2 + mu (1 - w) / (mu + w) c2.
  double mu = kLimit / (2 * given.back() - kLimit);
  for (std::size_t solution = 1; solution <= 3; ++solution, mu *= settings.growth) {
    int between = 0;
    for (std::size_t k = 0; k < given.size(); ++k) {
      const auto surrogate = [&](double w) { return w * given[k] + mu * (1 - w) / (mu + w) * kLimit; };
      const double weight = asked[solution][k];
      CAPTURE(solution, given[k], weight);
      for (int step = 0; step <= 1000; ++step) CHECK(surrogate(weight) <= surrogate(1e-3 * step) + 1e-9);
      between += given[k] < kLimit && weight < 1 ? 1 : 0;
    }
    CHECK(between > 5);
  }
}

}  // namespace
}  // namespace swiftlet
