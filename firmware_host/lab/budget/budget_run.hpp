#pragma once
// Replays logs in real time and compares the measurements with the budgets: for `swiftlet budget` and its
// tests.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware_host/interfaces/run_listener.hpp"
#include "firmware_host/lab/budget/budget_report.hpp"
#include "firmware_host/lab/budget/load_generator.hpp"

namespace swiftlet {

struct BudgetRequest {
  std::vector<std::string> logs;
  std::string out;  ///< folder that receives a run folder for each replay
  int passes = 1;   ///< number of passes over all logs
  bool mono = false;
  bool load = false;  ///< run with a load generator in parallel
  LoadSettings load_settings;
  bool show_progress = false;
};

struct BudgetResult {
  BudgetReport report;
  nlohmann::ordered_json json;  ///< the report, and counts of losses
  std::uint64_t frames = 0;
  std::uint64_t dropped = 0;  ///< frames
  std::uint64_t losses = 0;   ///< losses at arrows between threads
  std::uint64_t effort_changes = 0;
};

/// Adds the times of one run to `sum`.
void addMeasurements(const StageTable& times, BudgetMeasurements& sum);

/// InputError for bad input.
BudgetResult runBudget(const BudgetRequest& request, const Settings& settings);

}  // namespace swiftlet
