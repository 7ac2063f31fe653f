#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>

#include "drivers/input/input_error.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/reported_run.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/report/plain_page.hpp"
#include "firmware_host/lab/report/run_moments.hpp"
#include "firmware_host/outputs/page/page.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostImageBytes = std::size_t{512} * 1024;  // of all images of a report

struct ReportOptions {
  std::vector<std::string> runs;
  std::vector<std::string> truth;
  std::string out;
  bool plain = false;
  bool no_images = false;
  SettingsOptions settings;
};

int report(const ReportOptions& options) {
  if (!options.truth.empty() && options.truth.size() != 1 && options.truth.size() != options.runs.size()) {
    throw InputError("--truth", 0, "", "more truths than runs",
                     "Give one truth for all runs, or one for each");
  }
  const std::string out =
      options.out.empty() ? (fs::path(options.runs.front()) / "report.html").string() : options.out;
  if (fs::exists(out) && fs::path(out).extension() != ".html") {
    throw InputError(out, 0, "", "exists and is no page", "Give --out a new file, or one that ends in .html");
  }
  const Settings settings = options.settings.read();
  std::vector<ReportedRun> runs;
  for (std::size_t i = 0; i < options.runs.size(); ++i) {
    const std::string truth =
        options.truth.empty() ? "" : options.truth[std::min(i, options.truth.size() - 1)];
    ReportedRun& run = runs.emplace_back(readReportedRun(options.runs[i], truth, settings));
    std::vector<MissingFile>& missing = run.view.files.missing;
    if (!options.plain && !options.no_images) {
      RunMoments moments(run.view.files, "");
      run.moments = embeddedMoments(moments, kMostImageBytes / options.runs.size());
      // A run without a log has no images, which is no fault of the run folder.
      std::ranges::copy_if(moments.missing(), std::back_inserter(missing),
                           [](const MissingFile& one) { return one.file != "images"; });
    }
    for (const MissingFile& one : missing) {
      fmt::print(stderr, "note: {}: {}: {}\n", options.runs[i], one.file, one.what);
    }
  }
  const ReportProgram page = options.plain ? ReportProgram{} : readReportProgram();
  std::string html;
  if (page.name.empty()) {
    if (!options.plain) {
      fmt::print(stderr, "note: built without npm: the report has tables and static plots but no 3D view\n");
    }
    html = plainPage(runs);
  } else {
    html = pageWith(page.text, page.name, reportDocument(runs));
  }
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
  command->add_flag("--no-images", options->no_images, "Omit the images of the run's log");
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet report run_mh01\n"
      "  swiftlet report run_before run_after --out compared.html");
  command->callback([options, &exit_code] { exit_code = report(*options); });
}

}  // namespace swiftlet
