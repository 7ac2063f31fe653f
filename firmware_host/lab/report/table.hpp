#pragma once
// The report's tables: facts, figures and counters of a run, and what differs between two.

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
  bool folded = false;  ///< long: shown on a click
};

/// {"id", "title", "columns", "rows", "folded"}
nlohmann::ordered_json toJson(const Table& table);

/// A number as tables show it: five digits.
std::string shown(double value);

/// Facts, accuracy, latencies beside their budgets, CPU, memory, counters, settings. A table without rows is
/// left out.
std::vector<Table> tablesOf(const RunView& view);

/// What the settings, versions, accuracy, counters and costs of two runs have different: name, both values
/// and, of numbers, their difference. What only one of them has is named too.
std::vector<Table> differencesOf(const RunView& a, const RunView& b);

}  // namespace swiftlet
