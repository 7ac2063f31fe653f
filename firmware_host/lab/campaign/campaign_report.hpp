#pragma once
// Writes a campaign's table to files.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware_host/lab/campaign/campaign_table.hpp"

namespace swiftlet {

struct CampaignReport {
  CampaignTable table;
  std::vector<CampaignRow> rows;
  std::optional<CampaignComparison> comparison;
};

/// Writes into the folder `out`:
///   table.csv, table.json, table.md  one line per log
///   runs.csv                         one line per run
///   costs.csv                        CPU, time and memory: everything that differs between identical runs
///   table.html                       all of it, with a plot
/// All except costs.csv and table.html are functions of the rows' accuracy alone.
void writeCampaign(const CampaignReport& report, const std::string& out);

/// Content of table.md, also for the terminal.
std::string campaignMarkdown(const CampaignReport& report);

}  // namespace swiftlet
