#include "firmware_host/lab/calibrate/imu_noise/noise_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

namespace swiftlet {
namespace {

constexpr int kTerms = 4;
enum Term : std::uint8_t { kWhite, kWalk, kFlat, kQuantization };
using Terms = Eigen::Vector4d;

// Least gain of 2 log likelihood for an additional term: one in a hundred by chance.
constexpr double kGain = 6.6;
// RMS misfit in sigmas at which the search for the shortest cluster ends.
constexpr double kGoodMisfit = 1.6;
constexpr double kLongestStart = 1.0;  // s; the white noise is fitted from here at the latest
constexpr std::size_t kFewestPoints = 4;
// Pairs of clusters of a random walk are not independent, neither of their neighbours nor of other octaves.
// Factor by which its sigma is larger than for independent pairs, found from simulated logs of 20 minutes to
// 2 hours.
constexpr double kWalkSigma = 1.35;
const double kFlatFactor = 2 * std::numbers::ln2 / std::numbers::pi;

Terms shape(double tau) { return {1 / tau, tau / 3, kFlatFactor, 3 / (tau * tau)}; }

struct Fit {
  Terms squares = Terms::Zero();
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();   // of the squares; zero for absent terms
  double cost = std::numeric_limits<double>::infinity();  // -2 log likelihood plus what the terms must gain
  double misfit = 1;
  bool good = false;
};

/// Fits the terms in `mask` to the points from `first` on, by Fisher scoring. Not good if a term is not
/// positive.
Fit fitTerms(const std::vector<AllanPoint>& points, int axis, std::size_t first, unsigned mask,
             bool keep_negative = false) {
  std::array<int, kTerms> used{};
  int count = 0;
  for (int term = 0; term < kTerms; ++term) {
    if ((mask >> static_cast<unsigned>(term) & 1U) != 0) used[static_cast<std::size_t>(count++)] = term;
  }
  Fit fit;
  const auto rows = static_cast<Eigen::Index>(points.size() - first);
  if (rows <= count) return fit;
  Eigen::MatrixXd A(rows, count);
  Eigen::VectorXd seen(rows);
  Eigen::VectorXd half(rows);
  for (Eigen::Index r = 0; r < rows; ++r) {
    const AllanPoint& point = points[first + static_cast<std::size_t>(r)];
    for (int c = 0; c < count; ++c) A(r, c) = shape(point.tau)[used[static_cast<std::size_t>(c)]];
    seen[r] = point.variance[axis];
    half[r] = point.pairs / 2;
  }
  Eigen::VectorXd model = seen;
  Eigen::MatrixXd information(count, count);
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(count);
  constexpr int kIterations = 60;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Eigen::VectorXd weight = half.cwiseQuotient(model.cwiseAbs2());
    information = A.transpose() * weight.asDiagonal() * A;
    // Terms differ by many orders of magnitude.
    const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
    squares = scale.asDiagonal() *
              scaled.ldlt().solve(scale.asDiagonal() * (A.transpose() * weight.cwiseProduct(seen)));
    const Eigen::VectorXd next = A * squares;
    // A model that is not positive has no likelihood, so the step is limited.
    model = next.cwiseMax(0.1 * model).cwiseMin(10 * model);
  }
  if (!squares.allFinite() || (!keep_negative && squares.minCoeff() <= 0)) return fit;
  fit.good = true;
  fit.cost = kGain * count;
  double squared = 0;
  for (Eigen::Index r = 0; r < rows; ++r) {
    const double ratio = seen[r] / model[r];
    fit.cost += 2 * half[r] * (std::log(model[r]) + ratio);
    squared += half[r] * (ratio - 1) * (ratio - 1);
  }
  fit.misfit = std::sqrt(squared / static_cast<double>(rows - count));
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::MatrixXd covariance = scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
  for (int r = 0; r < count; ++r) {
    fit.squares[used[static_cast<std::size_t>(r)]] = squares[r];
    for (int c = 0; c < count; ++c) {
      fit.covariance(used[static_cast<std::size_t>(r)], used[static_cast<std::size_t>(c)]) = covariance(r, c);
    }
  }
  return fit;
}

Fit bestTerms(const std::vector<AllanPoint>& points, int axis, std::size_t first) {
  Fit best;
  for (unsigned mask = 1; mask < 1U << kTerms; mask += 2) {  // white noise in all
    const Fit fit = fitTerms(points, axis, first, mask);
    if (fit.good && fit.cost < best.cost) best = fit;
  }
  return best;
}

NoiseValue rootOf(const Fit& fit, Term term, double inflation) {
  const double value = std::sqrt(fit.squares[term]);
  return {value, value > 0 ? inflation * std::sqrt(fit.covariance(term, term)) / (2 * value) : 0};
}

}  // namespace

AxisNoise fitNoise(const std::vector<AllanPoint>& points, int axis) {
  Fit best;
  std::size_t start = 0;
  for (std::size_t first = 0; first + kFewestPoints <= points.size(); ++first) {
    if (first > 0 && points[first].tau > kLongestStart) break;
    const Fit fit = bestTerms(points, axis, first);
    if (!fit.good || (best.good && fit.misfit >= best.misfit)) continue;
    best = fit;
    start = first;
    if (fit.misfit < kGoodMisfit) break;
  }
  AxisNoise noise;
  if (!best.good) return noise;
  const double inflation = std::max(1.0, best.misfit);
  noise.from_tau = points[start].tau;
  noise.misfit = best.misfit;
  noise.density = rootOf(best, kWhite, inflation);
  noise.quantization = std::sqrt(best.squares[kQuantization]);
  const NoiseValue walk = rootOf(best, kWalk, kWalkSigma * inflation);
  if (walk.value > 0 && walk.sigma < kMostRelativeSigma * walk.value) {
    noise.walk = walk;
  } else {
    const Fit both = fitTerms(points, axis, start, 1U << kWhite | 1U << kWalk, true);
    noise.walk_limit = std::sqrt(std::max(0.0, both.squares[kWalk]) +
                                 2 * kWalkSigma * inflation * std::sqrt(both.covariance(kWalk, kWalk)));
  }
  std::size_t lowest = start;
  for (std::size_t i = start; i < points.size(); ++i) {
    if (points[i].variance[axis] < points[lowest].variance[axis]) lowest = i;
  }
  noise.instability = std::sqrt(points[lowest].variance[axis] / kFlatFactor);
  noise.instability_tau = points[lowest].tau;
  noise.instability_reached = lowest + 2 < points.size();
  for (const AllanPoint& point : points) noise.model.push_back(std::sqrt(shape(point.tau).dot(best.squares)));
  return noise;
}

}  // namespace swiftlet
