#include "firmware_host/lab/evaluation/position_accuracy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

/// Longest gap of the estimate: at 10 m/s^2 a straight line across it is off by 5 cm, less than such truths
/// are.
constexpr Duration kLongestGap = Duration::fromMilliseconds(200);

std::vector<PosePair> pairsOf(const Trajectory& estimate, std::span<const PositionPoint> truth,
                              Duration shift, const AssociationOptions& options) {
  std::vector<PosePair> pairs;
  for (const PositionPoint& point : truth) {
    const Stamp stamp = point.stamp + shift;
    if ((options.from && stamp < *options.from) || (options.until && stamp > *options.until)) continue;
    const std::optional<SE3> pose = interpolate(estimate, stamp, kLongestGap);
    if (pose) pairs.push_back({stamp, *pose, SE3(Eigen::Quaterniond::Identity(), point.p)});
  }
  return pairs;
}

/// The shift with the smallest RMSE among those that keep most of the pairs.
Duration fittedShift(const Trajectory& estimate, std::span<const PositionPoint> truth,
                     const PositionAccuracyOptions& options) {
  constexpr double kStep = 0.1;     // s; a vehicle at 10 m/s flies one metre in it
  constexpr double kKept = 0.8;     // of the largest number of pairs
  constexpr double kFinest = 1e-3;  // s
  const AssociationOptions& association = options.accuracy.association;
  const auto rmse = [&](double shift, std::size_t least) {
    const auto pairs = pairsOf(estimate, truth, Duration::fromSeconds(shift), association);
    if (pairs.size() < least) return std::numeric_limits<double>::infinity();
    const ErrorStatistics found = trajectoryError(pairs, options.accuracy.align).translation;
    return found.count == 0 ? std::numeric_limits<double>::infinity() : found.rmse;
  };
  const int steps = static_cast<int>(std::ceil(options.reach->seconds() / kStep));
  std::size_t most = 0;
  for (int i = -steps; i <= steps; ++i) {
    most = std::max(most, pairsOf(estimate, truth, Duration::fromSeconds(i * kStep), association).size());
  }
  const auto least = static_cast<std::size_t>(kKept * static_cast<double>(most));
  double best = 0;
  double smallest = std::numeric_limits<double>::infinity();
  for (int i = -steps; i <= steps; ++i) {
    const double found = rmse(i * kStep, least);
    if (found < smallest) {
      smallest = found;
      best = i * kStep;
    }
  }
  for (double step = kStep / 2; step > kFinest / 2; step /= 2) {
    for (const double shift : {best - step, best + step}) {
      const double found = rmse(shift, least);
      if (found < smallest) {
        smallest = found;
        best = shift;
      }
    }
  }
  return Duration::fromSeconds(best);
}

}  // namespace

PositionAccuracy positionAccuracy(const Trajectory& estimate, std::span<const PositionPoint> truth,
                                  const PositionAccuracyOptions& options) {
  PositionAccuracy result;
  result.positions = truth.size();
  if (options.reach) result.shift = fittedShift(estimate, truth, options);
  const std::vector<PosePair> pairs = pairsOf(estimate, truth, result.shift, options.accuracy.association);
  result.pairs = pairs.size();
  result.absolute = trajectoryError(pairs, options.accuracy.align);
  result.absolute.rotation = result.absolute.attitude = result.absolute.tilt = {};
  if (!pairs.empty()) result.duration = (pairs.back().stamp - pairs.front().stamp).seconds();
  return result;
}

}  // namespace swiftlet
