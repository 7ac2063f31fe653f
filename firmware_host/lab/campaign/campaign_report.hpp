#pragma once
// A campaign's table as files.

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
///   table.csv, table.json, table.md  a line for each log
///   runs.csv                         a line for each run
///   costs.csv                        CPU, time and memory: all that differs when the same is run again
///   table.html                       all of it, with a plot
/// All but costs.csv and table.html are functions of the rows' accuracy alone.
void writeCampaign(const CampaignReport& report, const std::string& out);

/// The content of table.md, for the terminal too.
std::string campaignMarkdown(const CampaignReport& report);

}  // namespace swiftlet
