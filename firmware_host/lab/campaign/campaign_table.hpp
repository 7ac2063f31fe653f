#pragma once
// A campaign's rows as a table: a line for each log, with the spread over its repeats, and two campaigns
// compared.

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware_host/lab/campaign/campaign_file.hpp"
#include "firmware_host/lab/campaign/campaign_row.hpp"
#include "firmware_host/lab/evaluation/error_statistics.hpp"

namespace swiftlet {

struct CampaignLine {
  std::string log;
  int asked = 0;  ///< repeats
  int done = 0;
  int failed = 0;
  int aborted = 0;
  std::vector<ErrorStatistics> accuracy;  ///< over the done runs that have it, of each of accuracyFigures()
  std::vector<ErrorStatistics> costs;     ///< over all runs that have it, of each of costFigures()
  std::vector<std::string> says;          ///< of failed and aborted runs, each once

  [[nodiscard]] int missing() const { return asked - done - failed - aborted; }
};

struct CampaignTable {
  std::vector<CampaignLine> lines;  ///< in the order of the campaign's file
  /// Over the means of the logs that have the figure, of each of accuracyFigures().
  std::vector<ErrorStatistics> accuracy;
  std::vector<ErrorStatistics> costs;

  /// Every run that was asked for was done.
  [[nodiscard]] bool isWhole() const;
};

CampaignTable campaignTable(const Campaign& campaign, std::span<const CampaignRow> rows);

/// One log in both campaigns, by its mean ATE.
struct ComparedLog {
  std::string log;
  double before = 0;
  double now = 0;
  /// The difference exceeds twice its standard error, from the repeats; none: fewer than two repeats.
  std::optional<bool> beyond_spread;

  [[nodiscard]] double ratio() const { return now / before; }
};

struct CampaignComparison {
  std::vector<ComparedLog> logs;  ///< that have an ATE in both
  std::vector<std::string> lost;  ///< that have one before only
  std::vector<std::string> won;   ///< that have one now only
  std::size_t smaller = 0;        ///< logs with a smaller ATE now
  double mean_ratio = 1;          ///< geometric mean over the logs
  /// 95 % interval of mean_ratio, by bootstrap over the logs; 0 to infinity: too few logs.
  double low = 0;
  double high = std::numeric_limits<double>::infinity();

  /// "better", "worse" or "no difference shown": by the interval; with a lost log "worse".
  [[nodiscard]] std::string verdict() const;
};

CampaignComparison compareCampaigns(const CampaignTable& before, const CampaignTable& now);

}  // namespace swiftlet
