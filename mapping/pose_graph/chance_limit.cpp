#include "mapping/pose_graph/chance_limit.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace swiftlet {
namespace {

/// Loops are of similar chance if their chances differ by less than this factor.
constexpr double kNear = 10;

}  // namespace

double logChanceLimit(double max_false, std::span<double> least_log_chances) {
  std::sort(least_log_chances.begin(), least_log_chances.end());
  const auto limit = [&](std::size_t tested) {
    return std::log(max_false) - std::log(static_cast<double>(tested));
  };
  const auto reaching = [&](std::size_t tested) {
    const auto end = std::upper_bound(least_log_chances.begin(), least_log_chances.end(), limit(tested));
    return static_cast<std::size_t>(end - least_log_chances.begin());
  };
  // The more are counted, the fewer can reach the limit.
  std::size_t low = 1;
  std::size_t high = std::max<std::size_t>(least_log_chances.size(), 1);
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    reaching(middle) <= middle ? high = middle : low = middle + 1;
  }
  return limit(low);
}

double logDiscoveryLimit(double max_false, std::size_t tested, std::span<double> log_chances) {
  std::sort(log_chances.begin(), log_chances.end());
  for (std::size_t k = log_chances.size(); k-- > 0;) {
    const double here = log_chances[k];
    const auto near = std::upper_bound(log_chances.begin(), log_chances.end(), here - std::log(kNear));
    const auto end = std::upper_bound(log_chances.begin(), log_chances.end(), here);
    const double expected = static_cast<double>(tested) * std::exp(here);
    if (expected <= max_false * static_cast<double>(end - near)) return here;
  }
  return -std::numeric_limits<double>::infinity();
}

}  // namespace swiftlet
