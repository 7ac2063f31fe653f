#pragma once
// Replays in real time and measures against the budgets: what `swiftlet budget` and its tests call.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware_host/interfaces/run_listener.hpp"
#include "firmware_host/lab/budget/budget_report.hpp"
#include "firmware_host/lab/budget/load_generator.hpp"

namespace swiftlet {

struct BudgetRequest {
  std::vector<std::string> logs;
  std::string out;  ///< folder: a run folder for each replay
  int passes = 1;   ///< over all logs
  bool mono = false;
  bool load = false;  ///< beside a load generator
  LoadSettings load_settings;
  bool show_progress = false;
};

struct BudgetResult {
  BudgetReport report;
  nlohmann::ordered_json json;  ///< the report, and what was lost on the way
  std::uint64_t frames = 0;
  std::uint64_t dropped = 0;  ///< frames
  std::uint64_t losses = 0;   ///< at arrows between threads
  std::uint64_t effort_changes = 0;
};

/// What the runs of one thread table add up to.
void addMeasurements(const StageTable& times, BudgetMeasurements& sum);

/// InputError for bad input.
BudgetResult runBudget(const BudgetRequest& request, const Settings& settings);

}  // namespace swiftlet
