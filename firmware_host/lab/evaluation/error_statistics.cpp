#include "firmware_host/lab/evaluation/error_statistics.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {

ErrorStatistics statisticsOf(std::vector<double> errors) {
  ErrorStatistics result;
  if (errors.empty()) return result;
  std::ranges::sort(errors);
  result.count = errors.size();
  const auto n = static_cast<double>(errors.size());
  double sum = 0;
  for (const double e : errors) {
    sum += e;
    result.sse += e * e;
  }
  result.mean = sum / n;
  result.rmse = std::sqrt(result.sse / n);
  double spread = 0;
  for (const double e : errors) spread += (e - result.mean) * (e - result.mean);
  result.deviation = std::sqrt(spread / n);
  result.min = errors.front();
  result.max = errors.back();
  const std::size_t half = errors.size() / 2;
  result.median = errors.size() % 2 == 1 ? errors[half] : 0.5 * (errors[half - 1] + errors[half]);
  return result;
}

}  // namespace swiftlet
