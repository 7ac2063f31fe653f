#pragma once
// The report's tables: facts, figures and counters of a run, and the differences between two runs.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware_host/lab/report/run_view.hpp"

namespace swiftlet {

struct Table {
  std::string id;
  std::string title;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
  bool folded = false;  ///< long table, shown on a click
};

/// {"id", "title", "columns", "rows", "folded"}
nlohmann::ordered_json toJson(const Table& table);

/// A number as tables show it: five digits.
std::string shown(double value);

/// Facts, accuracy, latencies with their budgets, CPU, memory, counters, settings. Tables without rows are
/// omitted.
std::vector<Table> tablesOf(const RunView& view);

/// Differences in settings, versions, accuracy, counters and costs of two runs: name, both values and, for
/// numbers, their difference. Values that only one run has are listed too.
std::vector<Table> differencesOf(const RunView& a, const RunView& b);

}  // namespace swiftlet
