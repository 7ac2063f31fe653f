#include "firmware_host/lab/budget/budget_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "estimator/core/units.hpp"
#include "firmware_host/lab/budget/xml_text.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kMedian = 0.5;
constexpr double kP99 = 0.99;
constexpr double kAxisStart = 1e-6;  // s
constexpr int kAxisDecades = 6;
constexpr int kColumnsPerDecade = 8;
constexpr int kColumns = kAxisDecades * kColumnsPerDecade;
constexpr std::string_view kHeights = ".:-=+*#@";

/// s; upper edge of a histogram column.
double columnEdge(int column) {
  return kAxisStart * std::pow(10.0, static_cast<double>(column + 1) / kColumnsPerDecade);
}

/// Counts per column: durations below the axis count in the first, above it in the last.
std::array<std::uint64_t, kColumns> columnsOf(const LatencyHistogram& histogram) {
  std::array<std::uint64_t, kColumns> columns{};
  std::uint64_t below = 0;
  for (int i = 0; i < kColumns; ++i) {
    const std::uint64_t up_to = i + 1 == kColumns ? histogram.count() : histogram.countUpTo(columnEdge(i));
    columns[static_cast<std::size_t>(i)] = up_to - below;
    below = up_to;
  }
  return columns;
}

/// Column heights are logarithmic in the counts, so that a single late step stays visible.
std::string picture(const LatencyHistogram& histogram) {
  const auto columns = columnsOf(histogram);
  const auto most = static_cast<double>(*std::max_element(columns.begin(), columns.end()));
  std::string line;
  for (const std::uint64_t count : columns) {
    if (count == 0) {
      line += ' ';
      continue;
    }
    const double share = most > 1 ? std::log(static_cast<double>(count)) / std::log(most) : 1;
    line += kHeights[static_cast<std::size_t>(std::lround(share * static_cast<double>(kHeights.size() - 1)))];
  }
  return line;
}

std::string axis() {
  constexpr std::array<const char*, kAxisDecades> kMarks = {"1us", "10us", "100us", "1ms", "10ms", "100ms"};
  std::string line;
  for (const char* mark : kMarks) line += fmt::format("|{:<{}}", mark, kColumnsPerDecade - 1);
  return line + "|1s";
}

double scaleOf(const BudgetFigure& figure) { return std::string_view(figure.name) == "spread" ? 1 : kToMs; }
const char* unitOf(const BudgetFigure& figure) {
  return std::string_view(figure.name) == "spread" ? "" : " ms";
}

std::string cell(const BudgetFigure& figure) {
  const double scale = scaleOf(figure);
  const std::string allowed =
      figure.allowed ? fmt::format("{:g}", *figure.allowed * scale) : std::string("-");
  return fmt::format("{:>10.3f}{}/{:>7}", figure.measured * scale, figure.missed() ? "!" : " ", allowed);
}

std::size_t nameWidth(const std::vector<BudgetRow>& rows) {
  std::size_t width = 0;
  for (const BudgetRow& row : rows) width = std::max(width, row.name.size());
  return width;
}

BudgetLimits limits(double p50_ms, double p99_ms, double max_ms) {
  return {p50_ms / kToMs, p99_ms / kToMs, max_ms / kToMs, {}};
}

std::string junitCase(const BudgetRow& row, const BudgetFigure& figure) {
  const std::string start =
      fmt::format(R"(    <testcase classname="budget.{}" name="{}" time="{:.6f}")", timeKindName(row.kind),
                  xmlText(row.name + " " + figure.name), scaleOf(figure) == 1 ? 0.0 : figure.measured);
  if (row.measured.count() == 0) {
    return start +
           ">\n"
           "      <failure type=\"not measured\" message=\"nothing was measured\"/>\n"
           "    </testcase>\n";
  }
  if (!figure.missed()) return start + "/>\n";
  const std::string message =
      fmt::format("{:.3f}{} measured, {:g}{} allowed", figure.measured * scaleOf(figure), unitOf(figure),
                  *figure.allowed * scaleOf(figure), unitOf(figure));
  return start + fmt::format(">\n      <failure type=\"missed\" message=\"{}\"/>\n    </testcase>\n",
                             xmlText(message));
}

}  // namespace

const char* timeKindName(TimeKind kind) { return kind == TimeKind::kCpu ? "cpu" : "wall"; }

const char* verdictName(BudgetVerdict verdict) {
  switch (verdict) {
    case BudgetVerdict::kMet:
      return "met";
    case BudgetVerdict::kMissed:
      return "missed";
    case BudgetVerdict::kNotMeasured:
      return "not measured";
    case BudgetVerdict::kShown:
      break;
  }
  return "shown";
}

std::vector<BudgetFigure> BudgetRow::figures() const {
  const double p50 = measured.percentile(kMedian);
  const double p99 = measured.percentile(kP99);
  return {{"p50", p50, allowed.p50},
          {"p99", p99, allowed.p99},
          {"max", measured.max(), allowed.max},
          {"spread", p50 > 0 ? p99 / p50 : 0, allowed.spread}};
}

BudgetVerdict BudgetRow::verdict() const {
  if (!allowed.any()) return BudgetVerdict::kShown;
  if (measured.count() == 0) return BudgetVerdict::kNotMeasured;
  const auto all = figures();
  const bool missed = std::any_of(all.begin(), all.end(), [](const BudgetFigure& f) { return f.missed(); });
  return missed ? BudgetVerdict::kMissed : BudgetVerdict::kMet;
}

void BudgetReport::add(std::string name, TimeKind kind, const LatencyHistogram& measured,
                       const BudgetLimits& allowed) {
  rows_.push_back({std::move(name), kind, measured, allowed});
}

bool BudgetReport::met() const {
  bool judged = false;
  for (const BudgetRow& row : rows_) {
    const BudgetVerdict verdict = row.verdict();
    if (verdict == BudgetVerdict::kMissed || verdict == BudgetVerdict::kNotMeasured) return false;
    judged = judged || verdict == BudgetVerdict::kMet;
  }
  return judged;
}

std::string BudgetReport::text() const {
  const std::size_t width = nameWidth(rows_);
  std::string text =
      fmt::format("measured / allowed [ms]\n{:<{}}  time{:>9}{:>19}{:>19}{:>19}{:>19}  verdict\n", "", width,
                  "count", "p50", "p99", "max", "p99/p50");
  for (const BudgetRow& row : rows_) {
    text += fmt::format("{:<{}}  {:<4}{:>9}", row.name, width, timeKindName(row.kind), row.measured.count());
    for (const BudgetFigure& figure : row.figures()) text += cell(figure);
    text += fmt::format("  {}\n", verdictName(row.verdict()));
  }
  text += fmt::format("\n{:<{}}       {}\n", "", width, axis());
  for (const BudgetRow& row : rows_) {
    if (row.measured.count() == 0) continue;
    text += fmt::format("{:<{}}  {:<4} {}\n", row.name, width, timeKindName(row.kind), picture(row.measured));
  }
  return text + fmt::format("\nbudgets {}\n", met() ? "met" : "missed");
}

nlohmann::ordered_json BudgetReport::json() const {
  Json rows = Json::array();
  for (const BudgetRow& row : rows_) {
    Json measured;
    Json allowed = Json::object();
    for (const BudgetFigure& figure : row.figures()) {
      const std::string key = scaleOf(figure) == 1 ? figure.name : std::string(figure.name) + "_ms";
      measured[key] = figure.measured * scaleOf(figure);
      if (figure.allowed) allowed[key] = *figure.allowed * scaleOf(figure);
    }
    Json histogram = Json::array();
    const auto columns = columnsOf(row.measured);
    for (int i = 0; i < kColumns; ++i) {
      const std::uint64_t count = columns[static_cast<std::size_t>(i)];
      if (count == 0) continue;
      histogram.push_back({{"from_ms", i == 0 ? 0.0 : columnEdge(i - 1) * kToMs}, {"count", count}});
    }
    rows.push_back({{"name", row.name},
                    {"kind", timeKindName(row.kind)},
                    {"count", row.measured.count()},
                    {"mean_ms", row.measured.mean() * kToMs},
                    {"measured", measured},
                    {"allowed", allowed},
                    {"verdict", verdictName(row.verdict())},
                    {"histogram", histogram}});
  }
  return {{"met", met()}, {"rows", rows}};
}

std::string BudgetReport::junit(const std::string& suite) const {
  std::string cases;
  int tests = 0;
  int failures = 0;
  for (const BudgetRow& row : rows_) {
    for (const BudgetFigure& figure : row.figures()) {
      if (!figure.allowed) continue;
      ++tests;
      failures += row.measured.count() == 0 || figure.missed() ? 1 : 0;
      cases += junitCase(row, figure);
    }
  }
  const std::string counts =
      fmt::format(R"(tests="{}" failures="{}" errors="0" skipped="0")", tests, failures);
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites {0}>\n  <testsuite name=\"{1}\" {0}>\n{2}"
      "    <system-out>{3}</system-out>\n  </testsuite>\n</testsuites>\n",
      counts, xmlText(suite), cases, xmlText(text(), XmlPlace::kContent));
}

BudgetReport evaluateBudgets(const BudgetMeasurements& measured, const BudgetsGroup& allowed) {
  const BudgetsGroup& b = allowed;
  const BudgetLimits spread{{}, {}, {}, b.image_to_pose_spread};
  BudgetReport report;
  report.add("propagate", TimeKind::kCpu, measured.propagate_cpu,
             limits(b.propagate_p50_ms, b.propagate_p99_ms, b.propagate_max_ms));
  report.add("track", TimeKind::kCpu, measured.track_cpu,
             limits(b.track_p50_ms, b.track_p99_ms, b.track_max_ms));
  report.add("smooth", TimeKind::kCpu, measured.smooth_cpu,
             limits(b.smooth_p50_ms, b.smooth_p99_ms, b.smooth_max_ms));
  if (measured.meshes) {
    report.add("mesh", TimeKind::kCpu, measured.mesh_cpu,
               limits(b.mesh_p50_ms, b.mesh_p99_ms, b.mesh_max_ms));
  }
  report.add("image to pose", TimeKind::kCpu, measured.image_to_pose_cpu,
             limits(b.image_to_pose_p50_ms, b.image_to_pose_p99_ms, b.image_to_pose_max_ms));
  report.add("... at keyframes", TimeKind::kCpu, measured.image_to_pose_cpu_keyframes, spread);
  report.add("... at other frames", TimeKind::kCpu, measured.image_to_pose_cpu_frames, spread);
  report.add("sample to state", TimeKind::kCpu, measured.sample_to_state_cpu,
             {b.sample_to_state_p50_ms / kToMs, b.sample_to_state_p99_ms / kToMs, {}, {}});
  report.add("track", TimeKind::kWall, measured.track_wall);
  report.add("smooth", TimeKind::kWall, measured.smooth_wall);
  report.add("image to pose", TimeKind::kWall, measured.image_to_pose_wall,
             {{}, b.image_to_pose_wall_p99_ms / kToMs, b.image_to_pose_wall_max_ms / kToMs, {}});
  report.add("exposure to pose", TimeKind::kWall, measured.exposure_to_pose_wall);
  report.add("sample to state", TimeKind::kWall, measured.sample_to_state_wall,
             {{}, b.sample_to_state_wall_p99_ms / kToMs, b.sample_to_state_wall_max_ms / kToMs, {}});
  report.add("bare timer loop", TimeKind::kWall, measured.bare_timer_wall);
  return report;
}

}  // namespace swiftlet
