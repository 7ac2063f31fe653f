#pragma once
// A campaign's rows as a table: one line per log with the spread over its repeats; and the comparison of two
// campaigns.

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
  int asked = 0;  ///< number of requested repeats
  int done = 0;
  int failed = 0;
  int aborted = 0;
  std::vector<ErrorStatistics> accuracy;  ///< of each of accuracyFigures(), over done runs that have it
  std::vector<ErrorStatistics> costs;     ///< of each of costFigures(), over all runs that have it
  std::vector<std::string> says;          ///< texts of failed and aborted runs, without duplicates

  [[nodiscard]] int missing() const { return asked - done - failed - aborted; }
};

struct CampaignTable {
  std::vector<CampaignLine> lines;  ///< in the order of the campaign's file
  /// Of each of accuracyFigures(), over the means of the logs that have it.
  std::vector<ErrorStatistics> accuracy;
  std::vector<ErrorStatistics> costs;

  /// Whether every requested run was done.
  [[nodiscard]] bool isWhole() const;
};

CampaignTable campaignTable(const Campaign& campaign, std::span<const CampaignRow> rows);

/// A log that is in both campaigns, with its mean ATE.
struct ComparedLog {
  std::string log;
  double before = 0;
  double now = 0;
  /// Whether the difference exceeds twice its standard error, from the repeats; empty: fewer than two
  /// repeats.
  std::optional<bool> beyond_spread;

  [[nodiscard]] double ratio() const { return now / before; }
};

struct CampaignComparison {
  std::vector<ComparedLog> logs;  ///< with an ATE in both
  std::vector<std::string> lost;  ///< with an ATE only before
  std::vector<std::string> won;   ///< with an ATE only now
  std::size_t smaller = 0;        ///< logs with a smaller ATE now
  double mean_ratio = 1;          ///< geometric mean over the logs
  /// 95 % interval of mean_ratio, by bootstrap over the logs; 0 to infinity if there are too few logs.
  double low = 0;
  double high = std::numeric_limits<double>::infinity();

  /// "better", "worse" or "no difference shown", from the interval; "worse" if a log was lost.
  [[nodiscard]] std::string verdict() const;
};

CampaignComparison compareCampaigns(const CampaignTable& before, const CampaignTable& now);

}  // namespace swiftlet
