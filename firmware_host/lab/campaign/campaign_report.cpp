#include "firmware_host/lab/campaign/campaign_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/report/plain_page.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kNone = "-";

std::string shownFigure(const CampaignFigure& figure, double value) {
  return fmt::format("{:.{}f}", value, figure.digits);
}

using Average = double ErrorStatistics::*;

std::string averageOf(const CampaignFigure& figure, const ErrorStatistics& statistics, Average average) {
  return statistics.count == 0 ? kNone : shownFigure(figure, statistics.*average);
}

std::string rangeOf(const CampaignFigure& figure, const ErrorStatistics& statistics) {
  if (statistics.count < 2) return kNone;
  return shownFigure(figure, statistics.min) + " to " + shownFigure(figure, statistics.max);
}

std::string runsOf(const CampaignLine& line) {
  std::string text = fmt::format("{} of {}", line.done, line.asked);
  if (line.failed > 0) text += fmt::format(", {} failed", line.failed);
  if (line.aborted > 0) text += fmt::format(", {} aborted", line.aborted);
  return text;
}

std::vector<std::string> cells(const std::string& log, const std::string& runs,
                               const std::vector<ErrorStatistics>& figures, Average average) {
  std::vector<std::string> row = {log, runs};
  for (std::size_t i = 0; i < figures.size(); ++i) {
    row.push_back(averageOf(accuracyFigures()[i], figures[i], average));
    if (i == 0) row.push_back(rangeOf(accuracyFigures()[i], figures[i]));
  }
  return row;
}

Table logsTable(const CampaignTable& table) {
  Table shown{"logs", "Logs: mean over the runs", {"log", "runs done"}, {}, false};
  for (const CampaignFigure& figure : accuracyFigures()) {
    shown.columns.emplace_back(figure.title);
    if (shown.columns.size() == 3) shown.columns.emplace_back("least to largest");
  }
  int asked = 0;
  int done = 0;
  for (const CampaignLine& line : table.lines) {
    shown.rows.push_back(cells(line.log, runsOf(line), line.accuracy, &ErrorStatistics::mean));
    asked += line.asked;
    done += line.done;
  }
  const std::string runs = fmt::format("{} of {}", done, asked);
  shown.rows.push_back(cells("mean over the logs", runs, table.accuracy, &ErrorStatistics::mean));
  shown.rows.push_back(cells("median over the logs", runs, table.accuracy, &ErrorStatistics::median));
  return shown;
}

Table complaintsTable(const CampaignTable& table) {
  Table shown{"failed", "Runs that failed, were aborted or are missing", {"log", "what"}, {}, false};
  for (const CampaignLine& line : table.lines) {
    for (const std::string& says : line.says) shown.rows.push_back({line.log, says});
    if (line.missing() > 0) shown.rows.push_back({line.log, fmt::format("{} not run", line.missing())});
  }
  return shown;
}

std::string comparisonTitle(const CampaignComparison& comparison) {
  const std::size_t logs = comparison.logs.size();
  std::string text = fmt::format("Beside the earlier campaign: {}; ", comparison.verdict());
  if (logs == 0) return text + "no log has an ATE in both";
  text += fmt::format("{:.3f} times the ATE over {} logs, smaller on {}", comparison.mean_ratio, logs,
                      comparison.smaller);
  if (comparison.low > 0) {
    text += fmt::format("; 95 % interval {:.3f} to {:.3f}", comparison.low, comparison.high);
  }
  return text;
}

Table comparisonTable(const CampaignComparison& comparison) {
  Table shown{"comparison",
              comparisonTitle(comparison),
              {"log", "before [m]", "now [m]", "ratio", "beyond the spread"},
              {},
              false};
  for (const ComparedLog& log : comparison.logs) {
    shown.rows.push_back({log.log, fmt::format("{:.4f}", log.before), fmt::format("{:.4f}", log.now),
                          fmt::format("{:.2f}", log.ratio()),
                          log.beyond_spread ? (*log.beyond_spread ? "yes" : "no") : kNone});
  }
  for (const std::string& log : comparison.lost)
    shown.rows.push_back({log, "a figure", "none", kNone, "yes"});
  for (const std::string& log : comparison.won) shown.rows.push_back({log, "none", "a figure", kNone, "yes"});
  return shown;
}

Table costsTable(const CampaignTable& table) {
  Table shown{"costs", "Costs: mean over the runs", {"log"}, {}, true};
  for (const CampaignFigure& figure : costFigures()) shown.columns.emplace_back(figure.title);
  const auto add = [&shown](const std::string& log, const std::vector<ErrorStatistics>& costs) {
    std::vector<std::string> row = {log};
    for (std::size_t i = 0; i < costs.size(); ++i) {
      row.push_back(averageOf(costFigures()[i], costs[i], &ErrorStatistics::mean));
    }
    shown.rows.push_back(std::move(row));
  };
  for (const CampaignLine& line : table.lines) add(line.log, line.costs);
  add("mean over the logs", table.costs);
  return shown;
}

std::string markdown(const Table& table) {
  if (table.rows.empty()) return "";
  const auto line = [](const std::vector<std::string>& row) {
    std::string text = "|";
    for (std::string cell : row) {
      for (std::size_t at = 0; (at = cell.find('|', at)) != std::string::npos; at += 2) cell.insert(at, "\\");
      text += " " + cell + " |";
    }
    return text + "\n";
  };
  std::string text = "## " + table.title + "\n\n" + line(table.columns) + "|";
  for (std::size_t i = 0; i < table.columns.size(); ++i) text += "---|";
  text += "\n";
  for (const auto& row : table.rows) text += line(row);
  return text + "\n";
}

std::string csvCell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + "\"";
}

std::string numberOr(bool known, double value) { return known ? fmt::format("{}", value) : ""; }

std::string statisticsHead(std::span<const CampaignFigure> figures) {
  std::string text;
  for (const CampaignFigure& figure : figures) {
    text += fmt::format(",{0}_mean,{0}_min,{0}_max,{0}_std", figure.name);
  }
  return text;
}

std::string statisticsCells(const std::vector<ErrorStatistics>& all) {
  std::string text;
  for (const ErrorStatistics& s : all) {
    for (const double value : {s.mean, s.min, s.max, s.deviation}) text += "," + numberOr(s.count > 0, value);
  }
  return text;
}

std::string logsCsv(const CampaignTable& table) {
  std::string text = "log,asked,done,failed,aborted" + statisticsHead(accuracyFigures()) + "\n";
  for (const CampaignLine& line : table.lines) {
    text += fmt::format("{},{},{},{},{}{}\n", line.log, line.asked, line.done, line.failed, line.aborted,
                        statisticsCells(line.accuracy));
  }
  return text;
}

std::string costsCsv(const CampaignTable& table) {
  std::string text = "log" + statisticsHead(costFigures()) + "\n";
  for (const CampaignLine& line : table.lines) text += line.log + statisticsCells(line.costs) + "\n";
  return text;
}

std::string runsCsv(const std::vector<CampaignRow>& rows) {
  std::string text = "log,repeat,outcome,says";
  for (const CampaignFigure& figure : accuracyFigures()) text += fmt::format(",{}", figure.name);
  text += "\n";
  for (const CampaignRow& row : rows) {
    text += fmt::format("{},{},{},{}", row.log, row.repeat, describe(row.outcome), csvCell(row.says));
    for (std::size_t i = 0; i < accuracyFigures().size(); ++i) {
      const bool known = i < row.accuracy.size() && row.accuracy[i].has_value();
      text += "," + numberOr(known, known ? *row.accuracy[i] : 0);
    }
    text += "\n";
  }
  return text;
}

Json statisticsJson(const std::vector<ErrorStatistics>& all) {
  Json json = Json::object();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const ErrorStatistics& s = all[i];
    Json& figure = json[std::string(accuracyFigures()[i].name)];
    if (s.count > 0) {
      figure = {{"runs", s.count}, {"mean", s.mean}, {"min", s.min}, {"max", s.max}, {"std", s.deviation}};
    }
  }
  return json;
}

Json comparisonJson(const CampaignComparison& comparison) {
  Json logs = Json::array();
  for (const ComparedLog& log : comparison.logs) {
    logs.push_back({{"log", log.log},
                    {"before_m", log.before},
                    {"now_m", log.now},
                    {"ratio", log.ratio()},
                    {"beyond_spread", log.beyond_spread ? Json(*log.beyond_spread) : Json(nullptr)}});
  }
  return {{"verdict", comparison.verdict()},
          {"mean_ratio", comparison.logs.empty() ? Json(nullptr) : Json(comparison.mean_ratio)},
          {"interval_95", comparison.low > 0 ? Json{comparison.low, comparison.high} : Json(nullptr)},
          {"smaller", comparison.smaller},
          {"logs", logs},
          {"lost", comparison.lost},
          {"won", comparison.won}};
}

Json tableJson(const CampaignReport& report) {
  Json logs = Json::array();
  for (const CampaignLine& line : report.table.lines) {
    logs.push_back({{"log", line.log},
                    {"asked", line.asked},
                    {"done", line.done},
                    {"failed", line.failed},
                    {"aborted", line.aborted},
                    {"says", line.says},
                    {"accuracy", statisticsJson(line.accuracy)}});
  }
  Json json = {{"logs", logs}, {"over_logs", statisticsJson(report.table.accuracy)}};
  if (report.comparison) json["comparison"] = comparisonJson(*report.comparison);
  return json;
}

/// Sorted means: the share of logs below an error.
Series risingMeans(const std::string& name, std::vector<double> errors) {
  std::sort(errors.begin(), errors.end());
  Series series{name, SeriesStyle::kLine, {}, {}, {}};
  for (std::size_t i = 0; i < errors.size(); ++i) {
    series.x.push_back(100.0 * static_cast<double>(i + 1) / static_cast<double>(errors.size()));
    series.y.push_back(errors[i]);
  }
  return series;
}

Plot errorPlot(const CampaignReport& report) {
  Plot plot;
  plot.id = "errors";
  plot.title = "ATE of the logs, from the least to the largest";
  plot.x_label = "logs with a smaller error [%]";
  plot.y_label = "m";
  std::vector<double> now;
  for (const CampaignLine& line : report.table.lines) {
    if (line.accuracy.front().count > 0) now.push_back(line.accuracy.front().mean);
  }
  plot.series.push_back(risingMeans("now", std::move(now)));
  if (report.comparison) {
    std::vector<double> before;
    for (const ComparedLog& log : report.comparison->logs) before.push_back(log.before);
    plot.series.push_back(risingMeans("before", std::move(before)));
  }
  return plot;
}

std::vector<Table> tables(const CampaignReport& report) {
  std::vector<Table> all;
  if (report.comparison) all.push_back(comparisonTable(*report.comparison));
  all.push_back(logsTable(report.table));
  all.push_back(complaintsTable(report.table));
  return all;
}

std::string html(const CampaignReport& report) {
  std::string text = svgPlot(errorPlot(report));
  for (const Table& table : tables(report)) {
    if (!table.rows.empty()) text += tableHtml(table);
  }
  return htmlDocument("swiftlet campaign", text + tableHtml(costsTable(report.table)));
}

}  // namespace

std::string campaignMarkdown(const CampaignReport& report) {
  std::string text = "# swiftlet campaign\n\n";
  for (const Table& table : tables(report)) text += markdown(table);
  text.pop_back();
  return text;
}

void writeCampaign(const CampaignReport& report, const std::string& out) {
  const std::filesystem::path folder(out);
  writeWholeFile(folder / "table.csv", logsCsv(report.table));
  writeWholeFile(folder / "table.json", tableJson(report).dump(2) + "\n");
  writeWholeFile(folder / "table.md", campaignMarkdown(report));
  writeWholeFile(folder / "runs.csv", runsCsv(report.rows));
  writeWholeFile(folder / "costs.csv", costsCsv(report.table));
  writeWholeFile(folder / "table.html", html(report));
}

}  // namespace swiftlet
