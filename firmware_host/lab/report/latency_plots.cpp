#include <cstdlib>
#include <set>
#include <sstream>

#include "drivers/recorded/parse_number.hpp"
#include "firmware_host/lab/report/run_plots.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

/// Parses "from_ms count, from_ms count" of summary.json; the series ends at the first malformed entry.
Series histogramSeries(const std::string& name, const std::string& text) {
  Series series{name, SeriesStyle::kLine, {}, {}, {}};
  std::istringstream columns(text);
  for (std::string column; std::getline(columns, column, ',');) {
    const std::size_t begin = column.find_first_not_of(' ');
    const std::size_t space = begin == std::string::npos ? begin : column.find(' ', begin);
    double from = 0;
    double count = 0;
    if (space == std::string::npos || !parseDouble(column.substr(begin, space - begin), from) ||
        !parseDouble(column.substr(space + 1), count)) {
      break;
    }
    series.x.push_back(from);
    series.y.push_back(count);
  }
  return series;
}

Plot latencyPlot(const RunView& view, const std::string& stage, const Json& kinds, const std::string& time) {
  Plot plot{"latency_" + stage + "_" + time,
            time == "cpu" ? "Latency, CPU time" : "Latency, wall time",
            stage,
            PlotKind::kHistogram,
            "ms",
            "count",
            "",
            {},
            {},
            {}};
  for (const auto& [kind, figures] : kinds.items()) {
    if (!figures.is_object() || !figures.contains(time) || !figures[time].is_object()) continue;
    const Json text = figures[time].value("histogram", Json());
    if (!text.is_string()) continue;
    const Series series = histogramSeries(kind, text.get<std::string>());
    if (!series.x.empty()) plot.series.push_back(series);
  }
  for (const auto& [figure, allowed] : budgetsOf(view, stage, time)) {
    plot.markers.push_back({allowed, "budget " + figure});
  }
  return plot;
}

}  // namespace

std::vector<std::pair<std::string, double>> budgetsOf(const RunView& view, const std::string& stage,
                                                      const std::string& time) {
  // The settings name the two budgets of a sample by their meaning, the timing by its stage.
  std::string name = stage;
  if (stage == "imu") name = time == "cpu" ? "propagate" : "sample_to_state";
  if (time == "wall") name += "_wall";
  std::vector<std::pair<std::string, double>> budgets;
  // Waiting times exist only in threaded runs.
  if (time == "wall" && view.files.text("executor/kind") == "lockstep") return budgets;
  const Json& settings = view.files.at("settings");
  if (!settings.is_object()) return budgets;
  for (const char* figure : {"p50", "p99", "max"}) {
    const auto found = settings.find("budgets." + name + "_" + figure + "_ms");
    if (found != settings.end() && found->is_number()) budgets.emplace_back(figure, found->get<double>());
  }
  return budgets;
}

std::vector<Plot> latencyPlots(const RunView& view) {
  std::vector<Plot> plots;
  const Json& timing = view.files.at("timing");
  if (!timing.is_object()) return plots;
  for (const char* time : {"cpu", "wall"}) {
    for (const auto& [stage, kinds] : timing.items()) {
      if (kinds.is_object()) plots.push_back(latencyPlot(view, stage, kinds, time));
    }
  }
  return plots;
}

std::vector<Plot> plotsOf(const RunView& view) {
  std::vector<Plot> plots;
  for (const auto& section : {trajectoryPlots, errorPlots, statePlots, intervalPlots, latencyPlots}) {
    for (Plot& plot : section(view)) {
      if (!plot.empty()) plots.push_back(std::move(plot));
    }
  }
  return plots;
}

}  // namespace swiftlet
