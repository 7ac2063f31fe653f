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
    fmt::print(stderr, "stopped before the end; the folder holds what was done\n");
    return kExitFailed;
  }
  if (!result.has_mesh) {
    fmt::print(stderr,
               "error: {}: no frame has a mesh; summary.json says what became of frames and landmarks\n",
               request.log);
    return kExitFailed;
  }
  return kExitDone;
}

}  // namespace

void addMeshCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("mesh", "Mesh a log's surroundings with given poses");
  auto options = std::make_shared<MeshOptions>();
  MeshRequest& request = options->request;
  request.out = "mesh";
  command
      ->add_option("LOG", request.log,
                   "EuRoC/ASL folder or an archive of one, a bag (rosbag2, MCAP, ROS 1), or a recorded run")
      ->required();
  command->add_option("--trajectory", request.trajectory,
                      "Poses of the body (TUM, EuRoC csv); default: the log's own truth");
  command->add_option("--out", request.out, "Folder to write")->capture_default_str();
  command->add_flag("--complete", request.complete,
                    "Also complete_mesh.ply: the mesh with a horizon over the whole flight");
  command
      ->add_option("--max-gap", request.max_gap,
                   "Poses are interpolated between neighbours at most this far apart [s]")
      ->check(positive())
      ->capture_default_str();
  command->add_flag("--mono", request.mono, "Camera 0 alone");
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
