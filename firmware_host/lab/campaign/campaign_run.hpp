#pragma once
// Runs a campaign: each log is replayed, once for each repeat, by a program of its own, and each replay
// leaves a row. A log is a job: any number of programs may run jobs of one campaign at once, on one machine
// or on many that share a disk, as long as no two run the same job.
//
// A repeat above 0 follows a few features more or fewer than the settings say, which changes what is tracked:
// the same log with the same settings gives the same bytes. Source: docs/accuracy.md.

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "firmware_host/lab/campaign/campaign_file.hpp"
#include "firmware_host/lab/campaign/campaign_row.hpp"

namespace swiftlet {

struct CampaignRequest {
  std::string out;      ///< folder: rows/, runs/, and logs/ while one is rendered
  std::string program;  ///< that replays and simulates
  std::string version;  ///< of `program`, as programVersion() gives it
  int jobs = 1;         ///< at once
};

/// What `program` says of its version, and a checksum of its file. InputError when it cannot be run.
std::string programVersion(const std::string& program);

/// The rows of the campaign's logs in the folder `out`, in the order of logs and repeats; aborted ones too.
std::vector<CampaignRow> storedRows(const Campaign& campaign, const std::string& out);

/// storedRows() of request.out. InputError for a row of other options or of another program.
std::vector<CampaignRow> campaignRows(const Campaign& campaign, const CampaignRequest& request);

/// Runs what is missing of one log. False: stopped.
bool runCampaignJob(const Campaign& campaign, const CampaignRequest& request, const CampaignLog& log,
                    const std::atomic<bool>& stop);

/// Runs what is missing of all, `jobs` at once; `ended` is called after each log, one call at a time. False:
/// stopped. An error of one ends all.
bool runCampaign(const Campaign& campaign, const CampaignRequest& request, const std::atomic<bool>& stop,
                 const std::function<void(const CampaignLog& log)>& ended);

}  // namespace swiftlet
