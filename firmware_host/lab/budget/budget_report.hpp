#pragma once
// Measured distributions compared with budgets: rows with verdicts, as a table with histograms, as JSON and
// as JUnit XML.
//
// CPU time is what a thread used itself; wall time is what a reader waited, including the machine's own
// lateness. A row never mixes them. Durations are in seconds in the code and in milliseconds in the output.

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware_host/realtime/latency_histogram.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

enum class TimeKind { kCpu, kWall };
/// "cpu", "wall".
const char* timeKindName(TimeKind kind);

enum class BudgetVerdict {
  kMet,
  kMissed,
  kNotMeasured,  ///< a budget without a measurement: as bad as a miss
  kShown,        ///< without a budget: for comparison only
};
/// "met", "missed", "not measured", "shown".
const char* verdictName(BudgetVerdict verdict);

/// Budgets; values that are not set are not judged.
struct BudgetLimits {
  std::optional<double> p50;
  std::optional<double> p99;
  std::optional<double> max;
  std::optional<double> spread;  ///< p99/p50

  [[nodiscard]] bool any() const { return p50 || p99 || max || spread; }
};

/// A measured value and its budget. Equal values meet the budget.
struct BudgetFigure {
  const char* name = "";  ///< "p50", "p99", "max", "spread"
  double measured = 0;
  std::optional<double> allowed;

  // Written so that NaN is a miss.
  [[nodiscard]] bool missed() const { return allowed.has_value() && !(measured <= *allowed); }
};

struct BudgetRow {
  std::string name;
  TimeKind kind = TimeKind::kCpu;
  LatencyHistogram measured;
  BudgetLimits allowed;

  [[nodiscard]] std::vector<BudgetFigure> figures() const;
  [[nodiscard]] BudgetVerdict verdict() const;
};

class BudgetReport {
 public:
  void add(std::string name, TimeKind kind, const LatencyHistogram& measured,
           const BudgetLimits& allowed = {});

  [[nodiscard]] const std::vector<BudgetRow>& rows() const { return rows_; }
  /// Whether there are rows with a budget, and all of them were measured and meet it.
  [[nodiscard]] bool met() const;

  /// The table, followed by a histogram per row on a common logarithmic axis from 1 us to 1 s.
  [[nodiscard]] std::string text() const;
  /// {"met", "rows": [{"name", "kind", "count", "mean_ms", "measured": {p50_ms ...}, "allowed": {...},
  /// "verdict", "histogram": [{"from_ms", "count"}]}]}
  [[nodiscard]] nlohmann::ordered_json json() const;
  /// One test case per value with a budget; failures give both values; the table is in system-out. `suite`:
  /// name of what was replayed.
  [[nodiscard]] std::string junit(const std::string& suite) const;

 private:
  std::vector<BudgetRow> rows_;
};

/// Measurements of a run for its budgets.
struct BudgetMeasurements {
  LatencyHistogram propagate_cpu;
  LatencyHistogram track_cpu;
  LatencyHistogram track_wall;
  LatencyHistogram smooth_cpu;
  LatencyHistogram smooth_wall;
  bool meshes = false;  ///< whether the runs mesh
  LatencyHistogram mesh_cpu;
  LatencyHistogram image_to_pose_cpu;            ///< all frames
  LatencyHistogram image_to_pose_cpu_keyframes;  ///< of these, keyframes
  LatencyHistogram image_to_pose_cpu_frames;     ///< of these, other frames
  LatencyHistogram image_to_pose_wall;           ///< from the arrival of the frame's last image
  LatencyHistogram exposure_to_pose_wall;        ///< from mid-exposure
  LatencyHistogram sample_to_state_cpu;
  LatencyHistogram sample_to_state_wall;
  LatencyHistogram bare_timer_wall;  ///< lateness of a loop that only sleeps, at the track thread's priority
};

/// The rows of `swiftlet budget`, judged by the settings' budgets; rows without a budget are only shown.
BudgetReport evaluateBudgets(const BudgetMeasurements& measured, const BudgetsGroup& allowed);

}  // namespace swiftlet
