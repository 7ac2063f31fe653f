#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <memory>
#include <thread>

#include "drivers/input/input_error.hpp"
#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/stop_signal.hpp"
#include "firmware_host/lab/campaign/campaign_report.hpp"
#include "firmware_host/lab/campaign/campaign_run.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/progress.hpp"

namespace swiftlet {
namespace {

struct CampaignOptions {
  std::string file;
  CampaignRequest request;
  std::string job;
  std::string beside;
  bool list = false;
  bool table = false;
};

/// Finds a log by its name, or by its number from 1.
const CampaignLog& logOf(const Campaign& campaign, const CampaignOptions& options) {
  for (const CampaignLog& log : campaign.logs) {
    if (log.name == options.job) return log;
  }
  std::size_t number = 0;
  const char* end = options.job.data() + options.job.size();
  const bool is_number = std::from_chars(options.job.data(), end, number).ptr == end;
  if (!is_number || number < 1 || number > campaign.logs.size()) {
    throw InputError(
        options.file, 0, "", "has no log `" + options.job + "`",
        fmt::format("Give a name that --list prints, or a number from 1 to {}", campaign.logs.size()));
  }
  return campaign.logs[number - 1];
}

int writeTable(const Campaign& campaign, const CampaignOptions& options) {
  CampaignReport report;
  report.rows = campaignRows(campaign, options.request);
  report.table = campaignTable(campaign, report.rows);
  if (!options.beside.empty()) {
    const std::vector<CampaignRow> before = storedRows(campaign, options.beside);
    if (before.empty()) {
      throw InputError(options.beside, 0, "", "has no run of these logs",
                       "Give the --out folder of an earlier campaign");
    }
    report.comparison = compareCampaigns(campaignTable(campaign, before), report.table);
  }
  writeCampaign(report, options.request.out);
  say(campaignMarkdown(report) + fmt::format("\nwritten to {}/table.*\n", options.request.out));
  return report.table.isWhole() ? kExitDone : kExitFailed;
}

int campaign(CampaignOptions options) {
  const Campaign campaign = readCampaign(options.file);
  if (options.list) {
    for (const CampaignLog& log : campaign.logs) say(log.name + "\n");
    return kExitDone;
  }
  CampaignRequest& request = options.request;
  const bool own = request.program.empty();
  request.program =
      own ? std::filesystem::read_symlink("/proc/self/exe") : std::filesystem::absolute(request.program);
  request.version = programVersion(request.program);
  static_cast<void>(campaignRows(campaign, request));  // refuses the folder of another campaign
  const std::atomic<bool>& stop = stopOnSignal();
  bool whole = true;
  if (!options.job.empty()) {
    whole = runCampaignJob(campaign, request, logOf(campaign, options), stop);
  } else if (!options.table) {
    Progress progress("logs", campaign.logs.size());
    std::uint64_t done = 0;
    whole = runCampaign(campaign, request, stop,
                        [&progress, &done](const CampaignLog& /*log*/) { progress.update(++done); });
    progress.finish();
  }
  if (!whole) {
    warn("stopped early; the same command goes on\n");
    return kExitFailed;
  }
  return options.job.empty() ? writeTable(campaign, options) : kExitDone;
}

}  // namespace

void addCampaignCommand(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("campaign", "Replay many logs and compare them with their truth in one table");
  auto options = std::make_shared<CampaignOptions>();
  options->request.out = "campaign";
  options->request.jobs = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  command->add_option("LOGS", options->file, "YAML file that lists the logs")->required();
  command->add_option("--out", options->request.out, "Folder to write; runs that it has are not repeated")
      ->capture_default_str();
  command->add_option("--jobs", options->request.jobs, "Logs at once. Default: one for each processor")
      ->check(CLI::Range(1, 1024));
  command->add_option("--program", options->request.program,
                      "The swiftlet that replays, another version for instance. Default: this one");
  command->add_option("--beside", options->beside, "Folder of an earlier campaign to compare with");
  CLI::Option* job = command->add_option(
      "--job", options->job,
      "Run one log, by name or number from 1, and write no table: for GNU parallel and Slurm");
  CLI::Option* table =
      command->add_flag("--table", options->table, "Run nothing; write the table of what has been run")
          ->excludes(job);
  command->add_flag("--list", options->list, "Print the names of the logs")->excludes(job)->excludes(table);
  command->footer(
      "Example:\n  swiftlet campaign logs.yaml --out today --jobs 4\n"
      "  swiftlet campaign logs.yaml --out new --beside today\n"
      "  swiftlet campaign logs.yaml --list | parallel swiftlet campaign logs.yaml --out night --job {}\n"
      "  sbatch --wait --array=1-200 --wrap 'swiftlet campaign logs.yaml --out night --job "
      "$SLURM_ARRAY_TASK_ID'\n"
      "  swiftlet campaign logs.yaml --out night --table");
  command->callback([options, &exit_code] { exit_code = campaign(*options); });
}

}  // namespace swiftlet
