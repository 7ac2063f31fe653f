#include <fmt/format.h>

#include <memory>

#include "drivers/input/input_error.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/lab/export/run_bag.hpp"
#include "firmware_host/lab/export/tum_files.hpp"

namespace swiftlet {
namespace {

struct ExportOptions {
  std::string run;
  std::string bag;
  std::string tum;
  std::string truth;
  bool no_truth = false;
  bool no_meshes = false;
  RosFrames frames;
};

/// Empty where the run's log is gone or has none: a run is exported without. A truth that was asked for must
/// be there.
Trajectory truthOf(const ExportOptions& options, const RunFolder& run) {
  if (options.no_truth) return {};
  if (!options.truth.empty()) return readTruth(options.truth, run.from_tracks).poses;
  if (run.log.empty()) return {};
  try {
    return readTruth(run.log, true).poses;
  } catch (const InputError& error) {
    fmt::print("without truth: {}\n", error.what());
    return {};
  }
}

void checkFrames(const RosFrames& frames) {
  const std::vector<std::string> names = {frames.map, frames.odom, frames.body, frames.truth};
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (names[i] != names[j]) continue;
      throw InputError("frames", 0, names[i], "names two frames", "Give each frame a name of its own");
    }
    if (names[i].empty() || names[i].front() == '/') {
      throw InputError("frames", 0, names[i], "is no frame of tf2", "Give a name that does not begin with /");
    }
  }
}

int exportRun(const ExportOptions& options) {
  checkFrames(options.frames);
  const RunFolder run = readRunFolder(options.run);
  const Trajectory truth = truthOf(options, run);
  if (!options.tum.empty()) {
    for (const std::string& name : writeTumFiles(run, truth, options.tum)) {
      fmt::print("{}/{}\n", options.tum, name);
    }
  }
  if (options.bag.empty()) return kExitDone;
  const BagTruth beside = truthBeside(run, truth);
  if (!truth.empty() && beside.poses.empty()) {
    fmt::print("without truth: none of its poses is at the time of the run's\n");
  }
  RunBagOptions bag_options;
  bag_options.frames = options.frames;
  bag_options.meshes = !options.no_meshes;
  for (const auto& [topic, messages] : writeRunBag(run, beside, bag_options, options.bag)) {
    fmt::print("  {:<24}{:>7}\n", topic, messages);
  }
  fmt::print("written to {}\n", options.bag);
  return kExitDone;
}

}  // namespace

void addExportCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("export", "A run folder for other programs: a ROS bag, TUM files");
  auto options = std::make_shared<ExportOptions>();
  command->add_option("RUN", options->run, "Run folder")->required();
  auto* wanted = command->add_option_group("formats", "At least one of");
  wanted->add_option("--bag", options->bag, "ROS 1 bag to write: for Foxglove, PlotJuggler, RViz");
  wanted->add_option("--tum", options->tum, "Folder for trajectories in TUM files: for evo");
  wanted->require_option(1, 2);
  CLI::Option* truth = command->add_option(
      "--truth", options->truth,
      "Log or trajectory file with the truth; default: the log the run was made from, where it is there");
  command->add_flag("--no-truth", options->no_truth, "Leave the truth out")->excludes(truth);
  command->add_flag("--no-meshes", options->no_meshes, "Leave the surfaces out of the bag");
  command->add_option("--map-frame", options->frames.map, "Frame of the map")->capture_default_str();
  command->add_option("--odom-frame", options->frames.odom, "Frame of the odometry's world")
      ->capture_default_str();
  command->add_option("--body-frame", options->frames.body, "Frame of the body, which is the IMU")
      ->capture_default_str();
  command->footer(
      "Example:\n  swiftlet export run_mh01 --bag run_mh01.bag\n"
      "  swiftlet export run_mh01 --tum evo && evo_ape tum evo/truth.tum evo/odometry.tum -a");
  command->callback([options, &exit_code] { exit_code = exportRun(*options); });
}

}  // namespace swiftlet
