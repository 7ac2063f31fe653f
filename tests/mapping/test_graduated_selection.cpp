#include "mapping/pose_graph/graduated_selection.hpp"

#include <catch2/catch.hpp>
#include <vector>

#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

/// A mean of measured points of the plane, as many true as said; the smallest problem with the same form.
class Mean : public WeightedLoops {
 public:
  Mean(int count, int true_count, Random& random) {
    for (int k = 0; k < count; ++k) {
      const bool good = k < true_count;
      x_.push_back(good ? 3 + random.normal() : random.uniform(-100, 300));
      y_.push_back(good ? 5 + random.normal() : random.uniform(-100, 300));
    }
  }
  Status solve(std::span<const double> weights, std::span<double> chi_squared) override {
    double sum = 0;
    double x = 0;
    double y = 0;
    for (std::size_t k = 0; k < weights.size(); ++k) {
      sum += weights[k];
      x += weights[k] * x_[k];
      y += weights[k] * y_[k];
    }
    if (!(sum > 0)) {
      return {StatusCode::kDegenerate, "no weight"};
    }
    for (std::size_t k = 0; k < weights.size(); ++k) {
      chi_squared[k] = (x_[k] - x / sum) * (x_[k] - x / sum) + (y_[k] - y / sum) * (y_[k] - y / sum);
    }
    return okStatus();
  }

 private:
  std::vector<double> x_, y_;
};

TEST_CASE("Graduated weights keep the true measurements of up to seven in ten false", "[pose_graph]") {
  Random random(4);
  for (const int count : {20, 40, 66}) {
    Mean mean(count, 20, random);
    std::vector<double> weights(static_cast<std::size_t>(count), 1.0);
    std::vector<double> chi_squared(weights.size());
    GraduatedSettings settings;
    settings.max_chi_squared = 20;
    GraduatedReport report;
    REQUIRE(selectGraduated(settings, mean, weights, chi_squared, report).ok());
    CHECK(report.settled);
    CHECK(report.solutions <= settings.max_solutions + settings.max_settling + 1);
    for (std::size_t k = 0; k < weights.size(); ++k) {
      CAPTURE(count, k, chi_squared[k]);
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
  std::vector<double> chi_squared(20);
  GraduatedSettings settings;
  settings.max_chi_squared = 20;
  GraduatedReport report;
  REQUIRE(selectGraduated(settings, mean, weights, chi_squared, report).ok());
  CHECK(report.kept == 20);
  std::fill(weights.begin(), weights.end(), 0.0);
  CHECK(selectGraduated(settings, mean, weights, chi_squared, report).code == StatusCode::kDegenerate);
}

}  // namespace
}  // namespace swiftlet
