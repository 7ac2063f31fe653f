#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "drivers/bag/bag_file.hpp"
#include "drivers/input/file_tree.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/asl_folder.hpp"
#include "drivers/recorded/open_log.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/log_options.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/lab/export/bag_output.hpp"
#include "firmware_host/lab/export/log_bag.hpp"
#include "firmware_host/lab/export/run_bag.hpp"
#include "firmware_host/lab/export/tum_files.hpp"

namespace swiftlet {
namespace {

struct ExportOptions {
  std::string from;
  std::string bag;
  std::string mcap;
  std::string rosbag2;
  std::string tum;
  std::string truth;
  bool no_truth = false;
  bool no_meshes = false;
  bool images = false;
  bool raw_images = false;
  int jpeg_quality = 0;
  LogCommandOptions log;
  RosFrames frames;
};

/// Empty if the run's log is missing or has no truth: the run is then exported without. A truth given as an
/// option must exist.
Trajectory truthOf(const ExportOptions& options, const RunFolder& run) {
  if (options.no_truth) return {};
  if (!options.truth.empty()) return onImageClock(readTruth(options.truth, run.from_tracks).poses, run.shift);
  if (run.log.empty()) return {};
  try {
    return onImageClock(readTruth(run.log, true).poses, run.shift);
  } catch (const InputError& error) {
    fmt::print("truth omitted: {}\n", error.what());
    return {};
  }
}

/// InputError if a name occurs twice; empty names are ignored. `things`: what is named, for the message.
void refuseRepeated(const std::vector<std::string>& names, const std::string& things) {
  std::set<std::string> seen;
  for (const std::string& name : names) {
    if (name.empty() || seen.insert(name).second) continue;
    throw InputError(things, 0, name, "names two " + things, "Give each its own name");
  }
}

void checkFrames(const RosFrames& frames) {
  const std::vector<std::string> names = {frames.map, frames.odom, frames.body, frames.truth};
  refuseRepeated(names, "frames");
  for (const std::string& name : names) {
    if (name.empty() || name.front() == '/') {
      throw InputError("frames", 0, name, "is not a valid tf2 frame name", "Remove the leading /");
    }
  }
}

void checkFiles(const ExportOptions& options) {
  std::vector<std::string> names;
  for (const std::string& name : {options.mcap, options.rosbag2, options.bag, options.tum}) {
    names.push_back(std::filesystem::path(name).lexically_normal().string());
  }
  refuseRepeated(names, "files");
}

/// Writes each requested bag.
void writeBags(const ExportOptions& options, const std::function<void(MessageBag&)>& fill) {
  for (const auto& [form, path] :
       {std::pair{BagForm::kRos1, options.bag}, std::pair{BagForm::kMcap, options.mcap},
        std::pair{BagForm::kRosbag2, options.rosbag2}}) {
    if (path.empty()) continue;
    for (const auto& [topic, messages] : writeBag(form, path, fill)) {
      fmt::print("  {:<28}{:>7}\n", topic, messages);
    }
    fmt::print("written to {}\n", path);
  }
}

std::unique_ptr<LogSource> openAll(const ExportOptions& options, const std::string& path) {
  LogOptions log;
  const std::vector<std::string>& calibration = options.log.calibration;
  if (!calibration.empty()) log.calibration = calibration[0];
  if (calibration.size() > 1) log.imu_calibration = calibration[1];
  log.imu_after_last_image = true;
  return openLog(path, log);
}

LogBagOptions bagOptions(const ExportOptions& options, bool in_run) {
  LogBagOptions log;
  log.frames = options.frames;
  log.raw_images = options.raw_images;
  log.jpeg_quality = options.jpeg_quality;
  log.truth = !in_run && !options.no_truth;
  log.transforms = !in_run;
  return log;
}

int exportLog(const ExportOptions& options) {
  if (!options.tum.empty()) {
    throw InputError(options.from, 0, "--tum", "a log has no estimated trajectory",
                     "Replay it and export the run");
  }
  if (!options.truth.empty()) {
    throw InputError(options.from, 0, "--truth", "a log is exported with its own truth",
                     "Omit --truth, or replay the log and export the run");
  }
  std::vector<std::string> warnings;
  writeBags(options, [&](MessageBag& bag) {
    const auto log = openAll(options, options.from);
    LogBag(*log, bagOptions(options, false), bag).writeRest();
    warnings = log->warnings();
  });
  for (const std::string& line : warnings) fmt::print("{}\n", line);
  return kExitDone;
}

int exportRun(const ExportOptions& options) {
  if (!options.log.calibration.empty() && !options.images) {
    throw InputError(options.from, 0, "--calibration",
                     "a run without --images is exported without calibration",
                     "Omit --calibration, or add --images");
  }
  const RunFolder run = readRunFolder(options.from);
  const Trajectory truth = truthOf(options, run);
  if (!options.tum.empty()) {
    for (const std::string& name : writeTumFiles(run, truth, options.tum)) {
      fmt::print("{}/{}\n", options.tum, name);
    }
  }
  const BagTruth beside = truthBeside(run, truth);
  if (!truth.empty() && beside.poses.empty()) {
    fmt::print("truth omitted: none of its poses is within the run's time\n");
  }
  RunBagOptions bag_options;
  bag_options.frames = options.frames;
  bag_options.meshes = !options.no_meshes;
  if (options.images && run.log.empty()) {
    throw InputError(options.from, 0, "--images", "the run does not say which log it was made from",
                     "Export the log into its own bag");
  }
  writeBags(options, [&](MessageBag& bag) {
    const auto log = options.images ? openAll(options, run.log) : nullptr;
    std::optional<LogBag> images;
    if (log != nullptr) images.emplace(*log, bagOptions(options, true), bag);
    writeRunBag(run, beside, bag_options, bag, images ? &*images : nullptr);
  });
  return kExitDone;
}

int exportAny(const ExportOptions& options) {
  checkFrames(options.frames);
  checkFiles(options);
  return isAslFolder(options.from) || isArchive(options.from) || isBag(options.from) ? exportLog(options)
                                                                                     : exportRun(options);
}

}  // namespace

void addExportCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand(
      "export", "Export a run or a log for other programs: MCAP, rosbag2, ROS 1 bag, TUM files");
  auto options = std::make_shared<ExportOptions>();
  command->add_option("RUN_OR_LOG", options->from, "Run folder or log (EuRoC folder or bag)")->required();
  auto* wanted = command->add_option_group("formats", "At least one of");
  wanted->add_option("--mcap", options->mcap,
                     "MCAP file to write, with ROS 2 messages: for Foxglove, Rerun and ros2 bag");
  wanted->add_option("--rosbag2", options->rosbag2,
                     "rosbag2 folder to write, with an SQLite file: for ros2 bag");
  wanted->add_option("--bag", options->bag, "ROS 1 bag to write: for PlotJuggler and RViz");
  wanted->add_option("--tum", options->tum, "Folder for trajectories as TUM files: for evo");
  wanted->require_option(1, 4);
  CLI::Option* truth =
      command->add_option("--truth", options->truth,
                          "Log or trajectory file with the truth. Default: the log of the run, if available");
  command->add_flag("--no-truth", options->no_truth, "Omit the truth")->excludes(truth);
  command->add_flag("--no-meshes", options->no_meshes, "Omit the surfaces");
  command->add_flag("--images", options->images, "For a run: include the images and IMU samples of its log");
  CLI::Option* raw =
      command->add_flag("--raw-images", options->raw_images,
                        "Write images as raw pixels (mono8) even if the log holds PNG or JPEG files");
  command
      ->add_option("--jpeg", options->jpeg_quality,
                   "Encode all images as JPEG of this quality, 1 to 100. Lower values make smaller files and "
                   "coarser images. Default: the log's own files or pixels")
      ->check(CLI::Range(1, 100))
      ->excludes(raw);
  options->log.addCalibration(*command);
  command->add_option("--map-frame", options->frames.map, "Name of the map frame")->capture_default_str();
  command->add_option("--odom-frame", options->frames.odom, "Name of the odometry frame")
      ->capture_default_str();
  command->add_option("--body-frame", options->frames.body, "Name of the body frame, which is the IMU")
      ->capture_default_str();
  command->footer(
      "Example:\n  swiftlet export run_mh01 --mcap run_mh01.mcap\n"
      "  swiftlet export data/euroc_mh01 --rosbag2 mh01\n"
      "  swiftlet export run_mh01 --tum evo && evo_ape tum evo/truth.tum evo/odometry.tum -a");
  command->callback([options, &exit_code] { exit_code = exportAny(*options); });
}

}  // namespace swiftlet
