#pragma once
// Sorts rows of a log by stamp; counts rows that were out of order or repeated.

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/recorded/log_warnings.hpp"

namespace swiftlet {

/// `Row` has a member `stamp`. Of rows with the same stamp the first is kept.
template <typename Row>
void orderByStamp(std::vector<Row>& rows, const std::string& name, LogCounters& counters,
                  LogWarnings& warnings) {
  std::size_t late = 0;
  std::int64_t first_late = 0;
  for (std::size_t i = 1, newest = 0; i < rows.size(); ++i) {
    if (rows[i].stamp < rows[newest].stamp) {
      if (late++ == 0) first_late = rows[i].stamp.ns;
    } else {
      newest = i;
    }
  }
  if (late > 0) {
    std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.stamp < b.stamp; });
    counters.out_of_order += late;
    warnings.add(name + ": " + std::to_string(late) + " rows out of order, sorted by stamp; the first has " +
                 std::to_string(first_late) + " ns");
  }
  const auto equal = [](const Row& a, const Row& b) { return a.stamp == b.stamp; };
  const auto first_equal = std::adjacent_find(rows.begin(), rows.end(), equal);
  if (first_equal != rows.end()) {
    const std::int64_t first_repeated = first_equal->stamp.ns;
    const auto end = std::unique(first_equal, rows.end(), equal);
    const auto repeated = static_cast<std::size_t>(rows.end() - end);
    counters.repeated_stamps += repeated;
    warnings.add(name + ": " + std::to_string(repeated) +
                 " rows repeat a stamp, only the first of each is used; the first stamp is " +
                 std::to_string(first_repeated) + " ns");
    rows.erase(end, rows.end());
  }
}

}  // namespace swiftlet
