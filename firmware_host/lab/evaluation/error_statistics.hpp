#pragma once
// evo's statistics of a list of errors: rmse, mean, median, std (population), min, max, sse.

#include <cstddef>
#include <vector>

namespace swiftlet {

struct ErrorStatistics {
  std::size_t count = 0;
  double rmse = 0;
  double mean = 0;
  double median = 0;  ///< mean of the middle two for even counts
  double deviation = 0;
  double min = 0;
  double max = 0;
  double sse = 0;
};

/// 0 if `whole` is 0.
inline double shareOf(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

/// All zero for an empty list.
ErrorStatistics statisticsOf(std::vector<double> errors);

}  // namespace swiftlet
