#include <fmt/format.h>

#include <memory>

#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/log_options.hpp"
#include "firmware_host/lab/modules/mesh_run.hpp"

namespace swiftlet {
namespace {

struct MeshOptions {
  MeshRequest request;
  SettingsOptions settings;
  LogCommandOptions log;
};

void printMeshing(const nlohmann::ordered_json& summary) {
  const auto& frames = summary["frames"];
  fmt::print("{} frames with a pose, {} keyframes, {} without a pose, {} jumps\n",
             frames["meshed"].get<std::uint64_t>(), frames["keyframes"].get<std::uint64_t>(),
             frames["without_pose"].get<std::uint64_t>(), frames["jumps"].get<std::uint64_t>());
  for (const auto& [name, timing] : summary["timing"].items()) {
    const auto& cpu = timing["cpu"];
    fmt::print("  {:<24} {:>6} times  p50 {:.3f}  p99 {:.3f}  max {:.3f} ms CPU\n", name,
               timing["count"].get<std::uint64_t>(), cpu["p50_ms"].get<double>(), cpu["p99_ms"].get<double>(),
               cpu["max_ms"].get<double>());
  }
}

int mesh(const MeshOptions& options) {
  MeshRequest request = options.request;
  options.log.fill(request);
  const MeshRunResult result = runMesh(request, options.settings.read());
  printMeshing(result.summary);
  fmt::print("written to {}\n", request.out);
  if (!result.finished) {
    fmt::print(stderr, "stopped early; the folder holds the results so far\n");
    return kExitFailed;
  }
  if (!result.has_mesh) {
    fmt::print(stderr,
               "error: {}: no frame has a mesh; see the counts of frames and landmarks in summary.json\n",
               request.log);
    return kExitFailed;
  }
  return kExitDone;
}

}  // namespace

void addMeshCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("mesh", "Build the mesh of a log from given poses");
  auto options = std::make_shared<MeshOptions>();
  MeshRequest& request = options->request;
  request.out = "mesh";
  command
      ->add_option("LOG", request.log,
                   "EuRoC/ASL folder or an archive of one, a bag (rosbag2, MCAP, ROS 1), or a recorded run")
      ->required();
  command->add_option("--trajectory", request.trajectory,
                      "Body poses (TUM, EuRoC csv). Default: the log's truth");
  command->add_option("--out", request.out, "Folder to write")->capture_default_str();
  command->add_flag("--complete", request.complete,
                    "Also write complete_mesh.ply: the mesh with its horizon extended over the whole flight");
  command->add_option("--max-gap", request.max_gap, "Largest gap between poses that are interpolated [s]")
      ->check(positive())
      ->capture_default_str();
  command->add_flag("--mono", request.mono, "Use camera 0 only");
  options->log.addCalibration(*command);
  options->log.addSection(*command, request);
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet mesh data/vil_v102 --out mesh_v102\n"
      "  swiftlet mesh data/euroc_mh01_20s --trajectory run_mh01/odometry.tum --out mesh_mh01\n"
      "  swiftlet mesh flight --complete --out mesh_flight");
  command->callback([options, &exit_code] { exit_code = mesh(*options); });
}

}  // namespace swiftlet
