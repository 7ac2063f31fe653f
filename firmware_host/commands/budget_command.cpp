#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "estimator/core/units.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/budget/budget_run.hpp"
#include "firmware_host/lab/budget/worst_case.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"

namespace swiftlet {
namespace {

struct BudgetOptions {
  BudgetRequest request;
  SettingsOptions settings;
  bool worst_case = false;
};

void printWorstCase(const Settings& settings) {
  const WorstCase worst =
      measureWorstCase(settings, [](const char* what) { fmt::print(stderr, "{}\n", what); });
  fmt::print("worst-case inputs: {} of {} features rendered, {} simulated, {} of {} landmarks\n",
             worst.features, kMaxFeatures, worst.tracks, worst.landmarks, kMaxLandmarks);
  fmt::print("{:<12}{:>8}{:>12}{:>12}{:>12}\n", "CPU [ms]", "count", "p50", "p99", "max");
  for (const StageId stage : {StageId::kImu, StageId::kTrack, StageId::kSmooth, StageId::kTrim}) {
    const StageTimes& times = worst.times[static_cast<std::size_t>(stage)];
    LatencyHistogram all = times.cpu_frames;
    all.add(times.cpu_keyframes);
    fmt::print("{:<12}{:>8}{:>12.3f}{:>12.3f}{:>12.3f}\n", stageName(stage), all.count(),
               all.percentile(0.5) * kToMs, all.percentile(0.99) * kToMs, all.max() * kToMs);
  }
}

int budget(const BudgetOptions& options) {
  const Settings settings = options.settings.read();
  if (options.worst_case) {
    printWorstCase(settings);
    return kExitDone;
  }
  std::filesystem::create_directories(options.request.out);
  BudgetRequest request = options.request;
  request.show_progress = true;
  const BudgetResult result = runBudget(request, settings);
  fmt::print("{}", result.report.text());
  fmt::print("{} frames; {} dropped, {} lost between threads, {} changes of effort\n", result.frames,
             result.dropped, result.losses, result.effort_changes);
  const std::filesystem::path out(request.out);
  writeJson(out / "budget.json", result.json);
  writeWholeFile(out / "budget.xml", result.report.junit("swiftlet budget") + "\n");
  fmt::print("written to {}\n", request.out);
  return result.report.met() ? kExitDone : kExitFailed;
}

}  // namespace

void addBudgetCommand(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("budget", "Replay logs in real time and compare the latency with its budgets");
  auto options = std::make_shared<BudgetOptions>();
  BudgetRequest& request = options->request;
  request.out = "budget";
  CLI::Option* logs =
      command->add_option("LOG", request.logs, "One or more recorded logs; results are pooled");
  command->add_option("--out", request.out, "Folder for budget.json, budget.xml (JUnit) and the runs")
      ->capture_default_str();
  command->add_option("--passes", request.passes, "Number of times all logs are replayed")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  command->add_flag("--mono", request.mono, "Use camera 0 only");
  CLI::Option* load =
      command->add_flag("--load", request.load, "Run beside programs that load CPU and memory");
  command
      ->add_option("--load-workers", request.load_settings.cpu_workers,
                   "Number of load programs that use CPU time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str()
      ->needs(load);
  CLI::Option* worst =
      command->add_flag("--worst-case", options->worst_case,
                        "Without a log: fill every stage to its limits and print the maximum latency");
  worst->excludes(logs);
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet budget data/euroc_mh01_20s --passes 2 --out budget_mh01\n"
      "  swiftlet budget data/euroc_mh01_20s --load\n"
      "  swiftlet budget --worst-case");
  command->callback([options, logs, worst, &exit_code] {
    if (logs->count() == 0 && worst->count() == 0) {
      throw CLI::RequiredError("LOG (or --worst-case)");
    }
    exit_code = budget(*options);
  });
}

}  // namespace swiftlet
