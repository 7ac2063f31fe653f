#pragma once
// Reads EuRoC/ASL camN/data.csv: `stamp [ns], file name`. The name need not match the stamp; if it is
// missing, the caller tries <stamp>.png and <stamp>.jpg.

#include <string>
#include <string_view>
#include <vector>

#include "drivers/recorded/csv_reader.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct ImageRow {
  Stamp stamp;
  std::string file;  ///< as written; empty if the row has no second field
};

std::vector<ImageRow> readImageList(const std::string& path, LogCounters& counters, LogWarnings& warnings);
std::vector<ImageRow> readImageListText(const std::string& name, std::string_view text, LogCounters& counters,
                                        LogWarnings& warnings);

}  // namespace swiftlet
