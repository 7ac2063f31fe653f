#include <fmt/format.h>

#include <map>

#include "estimator/core/units.hpp"
#include "firmware_host/lab/report/run_plots.hpp"
#include "firmware_host/lab/report/table.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

std::string plain(const Json& json) {
  if (json.is_string()) return json.get<std::string>();
  if (json.is_number_float()) return shown(json.get<double>());
  return json.dump();
}

/// Leaves of a tree as rows of path and value.
void addLeaves(const Json& json, const std::string& path, std::vector<std::vector<std::string>>& rows) {
  const bool branch = json.is_object() && !json.empty();
  if (!branch) {
    if (!json.is_null() && !json.is_object()) rows.push_back({path, plain(json)});
    return;
  }
  for (const auto& [key, value] : json.items()) addLeaves(value, path.empty() ? key : path + "." + key, rows);
}

Table leavesTable(const RunView& view, const char* part, const char* title, bool folded) {
  Table table{part, title, {"name", "value"}, {}, folded};
  addLeaves(view.files.at(part), "", table.rows);
  return table;
}

Table factsTable(const RunView& view) {
  Table table{"facts", "Run", {"what", "value"}, {}, false};
  const RunFiles& files = view.files;
  const auto add = [&](const char* what, const std::string& value) {
    if (!value.empty()) table.rows.push_back({what, value});
  };
  add("log", files.text("run/log"));
  add("truth", view.truth_name);
  add("calibration", files.text("calibration"));
  if (const auto cameras = files.number("run/cameras")) add("cameras", shown(*cameras));
  add("flight", fmt::format("{:.2f} s", (files.last_image - files.first_image).seconds()));
  if (const auto first = files.number("run/time_to_first_pose_s")) {
    add("first pose", fmt::format("{:.3f} s after the first image", *first));
  }
  add("poses", std::to_string(files.odometry.size()));
  if (const auto share = files.number("run/tracking_coverage")) {
    add("images with a pose", fmt::format("{:.1f} %", 100 * *share));
  }
  add("keyframes", std::to_string(files.states.size()));
  add("executor", files.text("executor/kind"));
  if (files.at("run/finished") == Json(false)) add("finished", "no: it was stopped");
  const Json& version = files.at("version");
  if (version.is_object()) {
    add("program", fmt::format("swiftlet {} ({}, {}, compiler {})", files.text("version/swiftlet"),
                               files.text("version/build_type"), files.text("version/cpu"),
                               files.text("version/compiler")));
  }
  return table;
}

Table accuracyTable(const RunView& view) {
  Table table{"accuracy", "Accuracy of odometry.tum, yaw alignment", {"what", "value"}, {}, false};
  if (!view.hasTruth()) return table;
  const Accuracy& accuracy = view.odometry;
  const TrajectoryError& absolute = accuracy.absolute;
  // One number per row, so that two runs can be compared.
  const auto add = [&](const std::string& what, double value) {
    table.rows.push_back({what, fmt::format("{:.4f}", value)});
  };
  table.rows = {{"poses", std::to_string(accuracy.estimates)},
                {"poses with truth", std::to_string(accuracy.pairs)}};
  if (absolute.translation.count == 0) return table;
  add("path [m]", absolute.path_length);
  add("ATE rmse [m]", absolute.translation.rmse);
  add("ATE median [m]", absolute.translation.median);
  add("ATE max [m]", absolute.translation.max);
  for (int axis = 0; axis < 3; ++axis)
    add(fmt::format("ATE rmse, {} [m]", "xyz"[axis]), absolute.axis_rmse[axis]);
  add("attitude rmse [deg]", absolute.attitude.rmse);
  add("attitude max [deg]", absolute.attitude.max);
  if (accuracy.over_time.translation.count > 0) {
    add(fmt::format("RPE over {:g} s [m]", accuracy.over_time.interval), accuracy.over_time.translation.rmse);
    add(fmt::format("RPE over {:g} s [deg]", accuracy.over_time.interval), accuracy.over_time.rotation.rmse);
  }
  for (const RelativeError& error : accuracy.over_distance) {
    add(fmt::format("RPE over {:g} m [%]", error.interval), error.translation.mean);
    add(fmt::format("RPE over {:g} m [deg/m]", error.interval), error.rotation.mean);
  }
  return table;
}

/// A figure with its budget: "3.2 / 9".
std::string beside(double measured, const std::map<std::string, double>& budgets, const std::string& figure) {
  const auto found = budgets.find(figure);
  if (found == budgets.end()) return shown(measured);
  return fmt::format("{} / {:g}{}", shown(measured), found->second,
                     measured <= found->second ? "" : " missed");
}

Table latencyTable(const RunView& view) {
  Table table{"latency",
              "Latency [ms], measured / budget",
              {"stage", "of", "time", "count", "mean", "p50", "p99", "max"},
              {},
              false};
  const Json& timing = view.files.at("timing");
  if (!timing.is_object()) return table;
  for (const auto& [stage, kinds] : timing.items()) {
    if (!kinds.is_object()) continue;
    for (const auto& [kind, figures] : kinds.items()) {
      for (const char* time : {"cpu", "wall"}) {
        const Json& measured = figures.is_object() ? figures.value(time, Json()) : Json();
        if (!measured.is_object()) continue;
        const auto budgets = budgetsOf(view, stage, time);
        const std::map<std::string, double> allowed(budgets.begin(), budgets.end());
        const auto value = [&](const char* name) {
          const auto found = measured.find(name);
          return found != measured.end() && found->is_number() ? found->get<double>() : 0.0;
        };
        table.rows.push_back({stage, kind, time, plain(figures.value("count", Json(0))),
                              shown(value("mean_ms")), beside(value("p50_ms"), allowed, "p50"),
                              beside(value("p99_ms"), allowed, "p99"),
                              beside(value("max_ms"), allowed, "max")});
      }
    }
  }
  return table;
}

Table memoryTable(const RunView& view) {
  Table table{"memory", "Memory [MiB]", {"what", "MiB"}, {}, false};
  if (const auto peak = view.files.number("memory/peak_resident_bytes")) {
    table.rows.push_back({"peak, resident", fmt::format("{:.1f}", *peak / kMebibyte)});
  }
  const Json& parts = view.files.at("memory/table_bytes");
  if (!parts.is_object()) return table;
  for (const auto& [part, bytes] : parts.items()) {
    if (bytes.is_number()) {
      table.rows.push_back({part, fmt::format("{:.1f}", bytes.get<double>() / kMebibyte)});
    }
  }
  return table;
}

Table warningsTable(const RunView& view) {
  Table table{"warnings", "Warnings of the input", {"warning"}, {}, false};
  const Json& warnings = view.files.at("warnings");
  if (!warnings.is_array()) return table;
  for (const Json& warning : warnings) table.rows.push_back({plain(warning)});
  return table;
}

Table loopsTable(const RunView& view) {
  Table table{"loops",
              "Loops that geometry verified",
              {"at [s]", "place of [s]", "verdict", "inliers", "1 sigma [m]", "1 sigma [deg]"},
              {},
              true};
  for (const MapLoop& loop : view.files.loops) {
    table.rows.push_back({fmt::format("{:.2f}", view.files.seconds(loop.new_stamp)),
                          fmt::format("{:.2f}", view.files.seconds(loop.old_stamp)),
                          std::string(verdictName(loop.verdict)), std::to_string(loop.inliers),
                          shown(loop.translation_sigma), shown(loop.rotation_sigma * kToDegrees)});
  }
  return table;
}

/// Figures for comparing two runs, by name.
std::map<std::string, std::string> namedFigures(const RunView& view, const std::string& part) {
  std::vector<std::vector<std::string>> rows;
  if (part == "accuracy") {
    for (const std::vector<std::string>& row : accuracyTable(view).rows) rows.push_back(row);
  } else {
    addLeaves(view.files.at(part), "", rows);
  }
  std::map<std::string, std::string> figures;
  for (const std::vector<std::string>& row : rows) {
    // Histograms and sums always differ and add nothing to their percentiles; stamps are also given in
    // seconds.
    if (row[0].ends_with(".histogram") || row[0].ends_with("total_s") || row[0].ends_with("_ns")) {
      continue;
    }
    figures[row[0]] = row[1];
  }
  return figures;
}

std::string differenceOf(const std::string& a, const std::string& b) {
  char* end_a = nullptr;
  char* end_b = nullptr;
  const double number_a = std::strtod(a.c_str(), &end_a);
  const double number_b = std::strtod(b.c_str(), &end_b);
  if (a.empty() || b.empty() || *end_a != '\0' || *end_b != '\0') return "";
  const std::string plus = number_b > number_a ? "+" : "";
  if (number_a == 0) return plus + shown(number_b - number_a);
  return fmt::format("{}{} ({}{:.1f} %)", plus, shown(number_b - number_a), plus,
                     100 * (number_b - number_a) / std::abs(number_a));
}

Table differenceTable(const RunView& a, const RunView& b, const char* part, const char* title, bool folded) {
  Table table{std::string("differences_") + part, title, {"what", "A", "B", "B - A"}, {}, folded};
  const auto of_a = namedFigures(a, part);
  const auto of_b = namedFigures(b, part);
  auto names = of_a;
  names.insert(of_b.begin(), of_b.end());
  const auto valueIn = [](const std::map<std::string, std::string>& figures, const std::string& name) {
    const auto found = figures.find(name);
    return found == figures.end() ? std::string() : found->second;
  };
  for (const auto& [name, unused] : names) {
    const std::string value_a = valueIn(of_a, name);
    const std::string value_b = valueIn(of_b, name);
    if (value_a == value_b) continue;
    table.rows.push_back({name, value_a.empty() ? "none" : value_a, value_b.empty() ? "none" : value_b,
                          differenceOf(value_a, value_b)});
  }
  return table;
}

std::vector<Table> withRows(const std::vector<Table>& all) {
  std::vector<Table> kept;
  for (const Table& table : all) {
    if (!table.rows.empty()) kept.push_back(table);
  }
  return kept;
}

}  // namespace

std::string shown(double value) { return fmt::format("{:.5g}", value); }

Json toJson(const Table& table) {
  return {{"id", table.id},
          {"title", table.title},
          {"columns", table.columns},
          {"rows", table.rows},
          {"folded", table.folded}};
}

std::vector<Table> tablesOf(const RunView& view) {
  return withRows({factsTable(view), accuracyTable(view), warningsTable(view), latencyTable(view),
                   leavesTable(view, "cpu", "CPU", false), memoryTable(view), loopsTable(view),
                   leavesTable(view, "counters", "Counters", true), leavesTable(view, "map", "Map", true),
                   leavesTable(view, "executor", "Executor", true),
                   leavesTable(view, "settings", "Settings", true)});
}

std::vector<Table> differencesOf(const RunView& a, const RunView& b) {
  return withRows(
      {differenceTable(a, b, "run", "What was run", false),
       differenceTable(a, b, "version", "Program", false),
       differenceTable(a, b, "settings", "Settings", false),
       differenceTable(a, b, "accuracy", "Accuracy of odometry.tum, yaw alignment", false),
       differenceTable(a, b, "counters", "Counters", true), differenceTable(a, b, "timing", "Latency", true),
       differenceTable(a, b, "cpu", "CPU", false), differenceTable(a, b, "memory", "Memory", true),
       differenceTable(a, b, "map", "Map", true)});
}

}  // namespace swiftlet
