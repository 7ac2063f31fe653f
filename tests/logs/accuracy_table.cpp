// Replays every log, with two cameras and with one, prints the accuracy table and compares it with the
// committed figures. Exit code 1 when a figure got worse by more than the rule allows, when a committed row
// is no longer produced, or when a log is not there.
//
//   accuracy_table [--update] [--out FOLDER] [--skip-without-logs]
//
// --update writes the new figures to docs/accuracy_committed.csv (rows of logs that were not found
// stay); --out keeps the run folders; --skip-without-logs, for CTest, ends with 77 where nobody named a
// folder of logs and the default one has none.

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "drivers/input/input_error.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/logs/accuracy_rows.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/skip.hpp"

namespace swiftlet {
namespace {

constexpr const char* kLogs[] = {"euroc_mh01_20s", "euroc_v101_micro", "vil_v102", "vil_mh05"};

std::filesystem::path committedFile() {
  return std::filesystem::path(SWIFTLET_SOURCE_DIR) / "docs" / "accuracy_committed.csv";
}

double rmse(const nlohmann::ordered_json& sections, const char* section) {
  const auto& figures = sections[section]["se3"];
  return figures.contains("ate_m") ? figures["ate_m"]["rmse"].get<double>()
                                   : std::numeric_limits<double>::quiet_NaN();
}

/// The rows of one replay; a log without a pose gives one that is worse than anything.
std::vector<AccuracyRow> rowsOf(const std::string& log, int cameras, const ReplayResult& result) {
  constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
  if (!result.summary.contains("accuracy")) return {{log, cameras, "odometry", kNothing, kNothing}};
  std::vector<AccuracyRow> rows;
  const auto& accuracy = result.summary["accuracy"];
  for (const char* trajectory : {"odometry", "states", "map"}) {
    if (!accuracy.contains(trajectory) || !accuracy[trajectory].is_object()) continue;
    const auto& sections = accuracy[trajectory];
    rows.push_back({log, cameras, trajectory, rmse(sections, "all"), rmse(sections, "from_3s")});
  }
  return rows;
}

std::vector<AccuracyRow> replayAll(const std::filesystem::path& out) {
  std::vector<AccuracyRow> rows;
  for (const char* log : kLogs) {
    const auto path = findLog(log);
    if (!path) continue;
    for (const int cameras : {2, 1}) {
      ReplayRequest request;
      request.accuracy = runAccuracyJson;
      request.log = *path;
      request.mono = cameras == 1;
      request.out = out / fmt::format("{}_{}", log, cameras == 1 ? "mono" : "stereo");
      fmt::print(stderr, "{} ...\n", request.out);
      const ReplayResult result = runReplay(request, Settings{});
      for (const AccuracyRow& row : rowsOf(log, cameras, result)) rows.push_back(row);
    }
  }
  return rows;
}

std::vector<AccuracyRow> committedRows() {
  std::ifstream file(committedFile());
  return file ? readAccuracyRows(file) : std::vector<AccuracyRow>{};
}

void update(const std::vector<AccuracyRow>& now, const std::vector<AccuracyRow>& committed) {
  std::ofstream file(committedFile());
  writeAccuracyRows(file, updatedRows(now, committed));
  if (!file.flush()) throw std::runtime_error("cannot write " + committedFile().string());
}

/// Logs of the table that are not there.
std::vector<std::string> missingLogs() {
  std::vector<std::string> missing;
  for (const char* log : kLogs) {
    if (!findLog(log)) missing.emplace_back(log);
  }
  return missing;
}

bool skipped() {
  if (std::getenv("SWIFTLET_DATA") != nullptr || missingLogs().size() < std::size(kLogs)) return false;
  printSkipped("", fmt::format("no recorded logs ({})", fmt::join(kLogs, ", ")), kRunWithData);
  return true;
}

int compareAll(bool wants_update, const std::string& out) {
  const bool keep = !out.empty();
  const std::filesystem::path folder =
      keep ? std::filesystem::path(out)
           : std::filesystem::temp_directory_path() / fmt::format("swiftlet_accuracy_{}", getpid());
  const std::vector<AccuracyRow> now = replayAll(folder);
  if (!keep) {
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
  }
  const std::vector<AccuracyRow> committed = committedRows();
  fmt::print("ATE RMSE, SE(3) alignment, truth gap at most 20 ms\n\n{}", accuracyMarkdown(now, committed));
  if (wants_update) {
    update(now, committed);
    fmt::print("written to {}\n", committedFile().string());
    return 0;
  }
  const std::vector<std::string> worse = findWorse(now, committed);
  for (const std::string& line : worse) fmt::print("WORSE: {}\n", line);
  const std::vector<std::string> lost = findLost(now, committed);
  for (const std::string& line : lost) {
    fmt::print("LOST: {}: committed, but not produced. If that is intended, run accuracy_table --update.\n",
               line);
  }
  const std::vector<std::string> missing = missingLogs();
  for (const std::string& log : missing) {
    fmt::print("MISSING: log {}. Name the folder of logs in SWIFTLET_DATA.\n", log);
  }
  return worse.empty() && lost.empty() && missing.empty() ? 0 : 1;
}

}  // namespace
}  // namespace swiftlet

int main(int argc, char** argv) {
  CLI::App app("Accuracy of replays on all logs beside the committed figures");
  bool wants_update = false;
  std::string out;
  app.add_flag("--update", wants_update, "Write the new figures to docs/accuracy_committed.csv");
  app.add_option("--out", out, "Keep the run folders here");
  bool skip_without_logs = false;
  app.add_flag("--skip-without-logs", skip_without_logs, "Exit code 77 where there is no folder of logs");
  CLI11_PARSE(app, argc, argv);
  try {
    if (skip_without_logs && swiftlet::skipped()) return swiftlet::kExitSkipped;
    return swiftlet::compareAll(wants_update, out);
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 2;
  }
}
