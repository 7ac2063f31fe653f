#pragma once
// Runs a campaign: each log is replayed, once per repeat, by a separate program, and each replay writes a
// row. A log is a job: any number of programs may run jobs of one campaign at once, on one machine or on
// several that share a disk, as long as no two run the same job.
//
// A repeat above 0 uses a few features more or fewer than set, which changes what is tracked, because equal
// logs and settings give equal bytes. Source: docs/accuracy.md.

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "firmware_host/lab/campaign/campaign_file.hpp"
#include "firmware_host/lab/campaign/campaign_row.hpp"

namespace swiftlet {

struct CampaignRequest {
  std::string out;      ///< folder for rows/, runs/, and logs/ while a log is rendered
  std::string program;  ///< program that replays and simulates
  std::string version;  ///< version of `program`, from programVersion()
  int jobs = 1;         ///< jobs run at once
};

/// Version reported by `program`, and a checksum of its file. InputError if it cannot be run.
std::string programVersion(const std::string& program);

/// The rows of the campaign's logs in the folder `out`, in the order of logs and repeats, including aborted
/// ones.
std::vector<CampaignRow> storedRows(const Campaign& campaign, const std::string& out);

/// storedRows() of request.out. InputError for a row with other options or of another program.
std::vector<CampaignRow> campaignRows(const Campaign& campaign, const CampaignRequest& request);

/// Runs the missing repeats of one log. False: stopped.
bool runCampaignJob(const Campaign& campaign, const CampaignRequest& request, const CampaignLog& log,
                    const std::atomic<bool>& stop);

/// Runs everything that is missing, `jobs` logs at once. `ended` is called after each log, one call at a
/// time. False: stopped. An error in one job ends all.
bool runCampaign(const Campaign& campaign, const CampaignRequest& request, const std::atomic<bool>& stop,
                 const std::function<void(const CampaignLog& log)>& ended);

}  // namespace swiftlet
