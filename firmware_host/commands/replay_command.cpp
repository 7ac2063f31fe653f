#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/kept_map_options.hpp"
#include "firmware_host/commands/lab_commands.hpp"
#include "firmware_host/commands/log_options.hpp"
#include "firmware_host/commands/verdict.hpp"
#include "firmware_host/commands/view_option.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/runs/replay_run.hpp"

namespace swiftlet {
namespace {

struct ReplayOptions {
  ReplayRequest request;
  SettingsOptions settings;
  LogCommandOptions log;
  ViewOption view;
};

std::string accuracyLine(const nlohmann::ordered_json& summary, const char* file, const char* section) {
  const auto& accuracy = summary["accuracy"];
  if (!accuracy.contains(file) || !accuracy[file].is_object()) return "";
  const auto& figures = accuracy[file][section]["se3"];
  if (!figures.contains("ate_m")) return "";
  return fmt::format("  {:<9}{:<8} ATE rmse {:.4f} m (se3, {} pairs)  attitude {:.3f} deg\n", file, section,
                     figures["ate_m"]["rmse"].get<double>(), figures["pairs"].get<std::size_t>(),
                     figures["attitude_deg"]["rmse"].get<double>());
}

std::string sameStampsLine(const nlohmann::ordered_json& accuracy) {
  if (!accuracy.contains("map_beside_odometry")) return "";
  const auto& figures = accuracy["map_beside_odometry"]["all"];
  if (figures["ratio"].is_null()) return "";
  return fmt::format("  map at the same stamps: {:.4f} m, odometry {:.4f} m, ratio {:.2f}\n",
                     figures["map_ate_rmse_m"].get<double>(), figures["odometry_ate_rmse_m"].get<double>(),
                     figures["ratio"].get<double>());
}

int replay(const ReplayOptions& options) {
  ReplayRequest request = options.request;
  options.log.fill(request);
  request.inspect = true;
  request.accuracy = labAccuracy();
  request.view = options.view.read();
  const ReplayResult result = runReplay(request, options.settings.read());
  say(summaryText(result.summary));
  if (result.summary.contains("accuracy")) {
    for (const char* file : {"odometry", "states", "map"}) {
      for (const char* section : {"all", "from_3s"}) {
        say(accuracyLine(result.summary, file, section));
      }
    }
    say(sameStampsLine(result.summary["accuracy"]));
  }
  say(fmt::format("written to {}\n", request.out));
  if (!result.finished) {
    warn("stopped early; the run folder holds the results so far\n");
    return kExitFailed;
  }
  if (!result.lost.empty()) {
    warn(fmt::format("error: {}; the run folder is incomplete\n", result.lost));
    return kExitFailed;
  }
  if (!result.has_pose) {
    warn(fmt::format("error: {}: no pose in the whole log; events.log shows what the start waited for\n",
                     request.log));
    return kExitFailed;
  }
  return verdictOf(result.summary);
}

}  // namespace

void addReplayCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("replay", "Run the estimator on a recorded log");
  auto options = std::make_shared<ReplayOptions>();
  ReplayRequest& request = options->request;
  request.out = "run";
  command
      ->add_option("LOG", request.log,
                   "EuRoC/ASL folder or an archive of one, a bag (rosbag2, MCAP, ROS 1), or a recorded run")
      ->required();
  command->add_option("--out", request.out, "Run folder to write")->capture_default_str();
  command->add_flag("--replace", request.replace,
                    "Replace files in --out even if they belong to a flight or were not written by swiftlet");
  command->add_flag("--mono", request.mono, "Use camera 0 only");
  options->log.addCalibration(*command);
  command->add_option("--tracks", request.tracks, "File of feature tracks to use instead of images");
  options->log.addSection(*command, request);
  command->add_flag("--imu-rate", request.imu_rate, "Also write imu_rate.tum, the state at every IMU sample");
  command->add_flag("--mesh-sequence", request.mesh_sequence,
                    "Also write meshes/: the mesh of every frame, and the horizon mesh at keyframes");
  CLI::Option* real_time = command->add_flag("--real-time", request.real_time,
                                             "Run on threads and feed the log at its recorded times");
  command->add_option("--speed", request.speed, "Speed relative to the recording (with --real-time)")
      ->check(CLI::Range(0.01, 100.0))
      ->needs(real_time);
  options->view.addTo(*command)->needs(real_time);
  command->add_flag("--loop-closure", request.loop_closure,
                    "Detect revisited places and correct drift in map.tum");
  addKeptMapOptions(*command, request.kept_maps);
  command->add_flag("--map", request.map, "Fuse depth into a labelled map: map.ply, map.glb");
  command->add_flag("--record", request.record,
                    "Record the estimator's inputs to recording/ in the run folder");
  CLI::Option* reproduce =
      command->add_flag("--reproduce", request.reproduce,
                        "LOG is a recording: repeat its threaded run byte for byte with its settings");
  options->settings.addTo(*command);
  // The recording has its own calibration, settings and section.
  for (const char* name :
       {"--mono", "--calibration", "--tracks", "--from", "--until", "--real-time", "--loop-closure",
        "--keep-map", "--in-map", "--extend", "--map", "--record", "--settings", "--set"}) {
    reproduce->excludes(command->get_option(name));
  }
  command->footer(
      "Example:\n  swiftlet replay data/euroc_mh01_20s --out run_mh01\n"
      "  swiftlet replay data/vil_v102 --mono --set mesh.enabled=false\n"
      "  swiftlet replay data/vil_v102 --real-time --record --out run\n"
      "  swiftlet replay data/vil_v102 --until 10 --keep-map room --out first\n"
      "  swiftlet replay data/vil_v102 --from 10 --in-map room --out second\n"
      "  swiftlet replay run --reproduce --out again");
  command->callback([options, &exit_code] { exit_code = replay(*options); });
}

}  // namespace swiftlet
