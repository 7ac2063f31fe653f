#include "firmware_host/lab/evaluation/relative_error.hpp"

#include <algorithm>

#include "estimator/core/units.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

/// Errors over all (i, j) where `position` (time or distance, rising) grows by `interval`.
RelativeError overIntervals(std::span<const PosePair> pairs, const std::vector<double>& position,
                            double interval, double translation_unit, double rotation_unit) {
  RelativeError result;
  result.interval = interval;
  std::vector<double> translation;
  std::vector<double> rotation;
  // Sums of many steps reach an interval with a rounding error.
  const double slack = 1e-9 * interval;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto found = std::ranges::lower_bound(position, position[i] + interval - slack);
    if (found == position.end()) break;
    if (*found - position[i] > 1.5 * interval) continue;
    const auto j = static_cast<std::size_t>(found - position.begin());
    const SE3 truth = pairs[i].truth.inverse() * pairs[j].truth;
    const SE3 estimate = pairs[i].estimate.inverse() * pairs[j].estimate;
    const SE3 error = truth.inverse() * estimate;
    translation.push_back(error.translation.norm() * translation_unit);
    rotation.push_back(logSo3(error.rotation).norm() * kToDegrees * rotation_unit);
  }
  result.translation = statisticsOf(std::move(translation));
  result.rotation = statisticsOf(std::move(rotation));
  return result;
}

}  // namespace

RelativeError relativeErrorOverTime(std::span<const PosePair> pairs, Duration delta) {
  std::vector<double> seconds;
  for (const PosePair& pair : pairs) seconds.push_back((pair.stamp - pairs.front().stamp).seconds());
  return overIntervals(pairs, seconds, delta.seconds(), 1, 1);
}

RelativeError relativeErrorOverDistance(std::span<const PosePair> pairs, double length) {
  std::vector<double> flown;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double step = i == 0 ? 0 : (pairs[i].truth.translation - pairs[i - 1].truth.translation).norm();
    flown.push_back((i == 0 ? 0 : flown.back()) + step);
  }
  return overIntervals(pairs, flown, length, 100 / length, 1 / length);
}

}  // namespace swiftlet
