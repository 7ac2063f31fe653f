#include "firmware_host/lab/campaign/campaign_table.hpp"

#include <algorithm>
#include <cmath>
#include <random>

namespace swiftlet {
namespace {

constexpr std::size_t kAte = 0;  // index in accuracyFigures()
constexpr std::size_t kResamples = 2000;
constexpr std::size_t kFewestForInterval = 3;  // logs; with fewer, a bootstrap is not meaningful

using Figures = std::vector<std::optional<double>> CampaignRow::*;

std::vector<ErrorStatistics> overRuns(std::span<const CampaignRow* const> rows, Figures figures,
                                      std::size_t count) {
  std::vector<ErrorStatistics> all;
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<double> values;
    for (const CampaignRow* row : rows) {
      if ((row->*figures).size() > i && (row->*figures)[i]) values.push_back(*(row->*figures)[i]);
    }
    all.push_back(statisticsOf(std::move(values)));
  }
  return all;
}

using LineFigures = std::vector<ErrorStatistics> CampaignLine::*;

std::vector<ErrorStatistics> overLogs(const std::vector<CampaignLine>& lines, LineFigures figures,
                                      std::size_t count) {
  std::vector<ErrorStatistics> all;
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<double> means;
    for (const CampaignLine& line : lines) {
      if ((line.*figures)[i].count > 0) means.push_back((line.*figures)[i].mean);
    }
    all.push_back(statisticsOf(std::move(means)));
  }
  return all;
}

CampaignLine lineOf(const CampaignLog& log, int repeats, std::span<const CampaignRow> rows) {
  CampaignLine line;
  line.log = log.name;
  line.asked = repeats;
  std::vector<const CampaignRow*> own;
  std::vector<const CampaignRow*> done;
  for (const CampaignRow& row : rows) {
    if (row.log != log.name) continue;
    own.push_back(&row);
    if (row.outcome == CampaignOutcome::kDone) done.push_back(&row);
    if (row.outcome == CampaignOutcome::kFailed) ++line.failed;
    if (row.outcome == CampaignOutcome::kAborted) ++line.aborted;
    if (!row.says.empty() && std::find(line.says.begin(), line.says.end(), row.says) == line.says.end()) {
      line.says.push_back(row.says);
    }
  }
  line.done = static_cast<int>(done.size());
  line.accuracy = overRuns(done, &CampaignRow::accuracy, accuracyFigures().size());
  line.costs = overRuns(own, &CampaignRow::costs, costFigures().size());
  return line;
}

std::optional<bool> beyondSpread(const ErrorStatistics& before, const ErrorStatistics& now) {
  if (before.count < 2 || now.count < 2) return std::nullopt;
  const auto variance = [](const ErrorStatistics& s) {  // of the mean
    return s.deviation * s.deviation / static_cast<double>(s.count - 1);
  };
  return std::abs(now.mean - before.mean) > 2 * std::sqrt(variance(before) + variance(now));
}

void addInterval(CampaignComparison& comparison) {
  std::vector<double> logs;
  for (const ComparedLog& log : comparison.logs) logs.push_back(std::log(log.ratio()));
  if (logs.empty()) return;
  const auto count = static_cast<double>(logs.size());
  double sum = 0;
  for (const double one : logs) sum += one;
  comparison.mean_ratio = std::exp(sum / count);
  if (logs.size() < kFewestForInterval) return;
  std::mt19937_64 random(1);  // fixed seed: equal rows give equal intervals
  std::vector<double> means;
  for (std::size_t i = 0; i < kResamples; ++i) {
    double total = 0;
    for (std::size_t j = 0; j < logs.size(); ++j) total += logs[random() % logs.size()];
    means.push_back(std::exp(total / count));
  }
  std::sort(means.begin(), means.end());
  comparison.low = means[kResamples / 40];
  comparison.high = means[kResamples - 1 - kResamples / 40];
}

}  // namespace

bool CampaignTable::isWhole() const {
  return std::all_of(lines.begin(), lines.end(),
                     [](const CampaignLine& line) { return line.done == line.asked; });
}

CampaignTable campaignTable(const Campaign& campaign, std::span<const CampaignRow> rows) {
  CampaignTable table;
  for (const CampaignLog& log : campaign.logs) table.lines.push_back(lineOf(log, campaign.repeats, rows));
  table.accuracy = overLogs(table.lines, &CampaignLine::accuracy, accuracyFigures().size());
  table.costs = overLogs(table.lines, &CampaignLine::costs, costFigures().size());
  return table;
}

std::string CampaignComparison::verdict() const {
  if (!lost.empty()) return "worse";
  if (high < 1) return "better";
  return low > 1 ? "worse" : "no difference shown";
}

CampaignComparison compareCampaigns(const CampaignTable& before, const CampaignTable& now) {
  CampaignComparison comparison;
  for (const CampaignLine& line : now.lines) {
    const auto old = std::find_if(before.lines.begin(), before.lines.end(),
                                  [&line](const CampaignLine& other) { return other.log == line.log; });
    const ErrorStatistics& is = line.accuracy[kAte];
    const ErrorStatistics was = old == before.lines.end() ? ErrorStatistics{} : old->accuracy[kAte];
    if (was.count > 0 && is.count == 0) comparison.lost.push_back(line.log);
    if (was.count == 0 && is.count > 0) comparison.won.push_back(line.log);
    if (was.mean <= 0 || is.mean <= 0) continue;
    comparison.logs.push_back({line.log, was.mean, is.mean, beyondSpread(was, is)});
    if (is.mean < was.mean) ++comparison.smaller;
  }
  addInterval(comparison);
  return comparison;
}

}  // namespace swiftlet
