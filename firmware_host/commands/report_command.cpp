#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>

#include "drivers/input/input_error.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/evaluation/confusion_picture.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/lab/report/plain_page.hpp"
#include "firmware_host/outputs/page/page.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

struct ReportOptions {
  std::vector<std::string> runs;
  std::vector<std::string> truth;
  std::string out;
  bool plain = false;
  SettingsOptions settings;
};

ReportedRun readRun(const std::string& folder, const std::string& given_truth, const Settings& settings) {
  RunFiles files = readRunFiles(folder);
  const std::string log = files.text("run/log");
  const std::string source = given_truth.empty() ? log : given_truth;
  Truth truth;
  if (!source.empty()) {
    try {
      truth = readTruth(source, true);
    } catch (const InputError& error) {
      // That a log has no truth is no fault of the run; a truth that was asked for has to be there.
      if (!given_truth.empty()) throw;
      files.missing.push_back({"truth", error.what()});
    }
  }
  ReportedRun run;
  const fs::path world = fs::is_directory(source) ? fs::path(source) : fs::path(log);
  try {
    if (!world.empty() && fs::exists(world / "truth" / "mesh.ply")) {
      run.true_surface = (world / "truth" / "mesh.ply").string();
    }
    if (!world.empty()) run.labels = readLabelNames(world.string());
  } catch (const InputError& error) {
    files.missing.push_back({"labels.csv", error.what()});
  }
  run.view = viewOf(std::move(files), truth.poses, truth.name,
                    accuracyOptions(settings.evaluation, AlignKind::kYaw));
  return run;
}

int report(const ReportOptions& options) {
  if (!options.truth.empty() && options.truth.size() != 1 && options.truth.size() != options.runs.size()) {
    throw InputError("--truth", 0, "", "more truths than runs",
                     "Give one truth for all runs, or one for each");
  }
  const Settings settings = options.settings.read();
  std::vector<ReportedRun> runs;
  for (std::size_t i = 0; i < options.runs.size(); ++i) {
    const std::string truth =
        options.truth.empty() ? "" : options.truth[std::min(i, options.truth.size() - 1)];
    runs.push_back(readRun(options.runs[i], truth, settings));
    for (const MissingFile& missing : runs.back().view.files.missing) {
      fmt::print(stderr, "note: {}: {}: {}\n", options.runs[i], missing.file, missing.what);
    }
  }
  const std::string page = options.plain ? "" : findReportPage();
  std::string html;
  if (page.empty()) {
    if (!options.plain) {
      fmt::print(stderr, "note: built without npm: the report has tables and static plots but no 3D view\n");
    }
    html = plainPage(runs);
  } else {
    std::ifstream file(page, std::ios::binary);
    html = pageWith(std::string(std::istreambuf_iterator<char>(file), {}), page, reportDocument(runs));
  }
  const std::string out =
      options.out.empty() ? (fs::path(options.runs.front()) / "report.html").string() : options.out;
  writeWholeFile(out, html + "\n");
  fmt::print("written to {} ({:.2f} MiB)\n", out, static_cast<double>(html.size()) / kMebibyte);
  return kExitDone;
}

}  // namespace

void addReportCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("report", "Show one run, or compare two, in an HTML file");
  auto options = std::make_shared<ReportOptions>();
  command->add_option("RUN", options->runs, "Run folder; give two to compare them")
      ->required()
      ->expected(1, 2);
  command->add_option("--out", options->out, "File to write. Default: report.html in the first run folder");
  command
      ->add_option("--truth", options->truth,
                   "Log or trajectory file with the truth: one for all runs or one for each. Default: the "
                   "log of the run")
      ->expected(1, 2);
  command->add_flag("--plain", options->plain, "Write only tables and static plots, without scripts");
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet report run_mh01\n"
      "  swiftlet report run_before run_after --out compared.html");
  command->callback([options, &exit_code] { exit_code = report(*options); });
}

}  // namespace swiftlet
