#include <fmt/format.h>

#include <memory>

#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/log_options.hpp"
#include "firmware_host/lab/modules/fuse_run.hpp"

namespace swiftlet {
namespace {

struct FuseOptions {
  FuseRequest request;
  SettingsOptions settings;
  LogCommandOptions log;
};

void printFusion(const nlohmann::ordered_json& summary) {
  const auto& moments = summary["moments"];
  const auto& map = summary["map"];
  fmt::print("{} depth images fused ({} with labels), {} without a pose, {} rejected; {} triangles\n",
             moments["fused"].get<std::uint64_t>(), moments["with_labels"].get<std::uint64_t>(),
             moments["without_pose"].get<std::uint64_t>(), moments["refused"].get<std::uint64_t>(),
             map["mesh"]["faces"].get<std::uint64_t>());
  for (const auto& [name, timing] : summary["timing"].items()) {
    const auto& cpu = timing["cpu"];
    fmt::print("  {:<10} {:>6} times  p50 {:.2f}  p99 {:.2f}  max {:.2f} ms CPU\n", name,
               timing["count"].get<std::uint64_t>(), cpu["p50_ms"].get<double>(), cpu["p99_ms"].get<double>(),
               cpu["max_ms"].get<double>());
  }
}

int fuse(const FuseOptions& options) {
  FuseRequest request = options.request;
  options.log.fill(request);
  const FuseRunResult result = runFuse(request, options.settings.read());
  printFusion(result.summary);
  fmt::print("written to {}\n", request.out);
  if (!result.finished) {
    fmt::print(stderr, "stopped early; the folder holds the results so far\n");
    return kExitFailed;
  }
  if (!result.has_surface) {
    fmt::print(stderr, "error: {}: no surface; see the counts of depth images in summary.json\n",
               request.log);
    return kExitFailed;
  }
  if (!result.problem.empty()) {
    fmt::print(stderr, "error: {}\n", result.problem);
    return kExitFailed;
  }
  return kExitDone;
}

}  // namespace

void addFuseCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("fuse", "Build the labelled map of a log from given poses");
  auto options = std::make_shared<FuseOptions>();
  FuseRequest& request = options->request;
  request.out = "fuse";
  command
      ->add_option("LOG", request.log,
                   "EuRoC/ASL folder with depth0 or two cameras; labels0 is used if present")
      ->required();
  command->add_option("--trajectory", request.trajectory,
                      "Body poses (TUM, EuRoC csv). Default: the log's truth");
  command->add_option("--out", request.out, "Folder to write")->capture_default_str();
  command->add_option("--keep", request.keep, "File in which the map is kept, to continue it later");
  command
      ->add_option("--continue", request.continued,
                   "Start from this kept map; the poses must be in its frame")
      ->check(CLI::ExistingFile);
  addChoice<DepthSource>(
      *command, "--depth", request.depth, "Source of depth; sensor is depth0 of the log",
      {{"any", DepthSource::kAny}, {"sensor", DepthSource::kSensor}, {"stereo", DepthSource::kStereo}});
  command
      ->add_option("--interval", request.interval,
                   "Seconds between matched stereo pairs; pairs with labels are always matched")
      ->check(positive())
      ->capture_default_str();
  command->add_option("--max-gap", request.max_gap, "Largest gap between poses that are interpolated [s]")
      ->check(positive())
      ->capture_default_str();
  options->log.addCalibration(*command);
  options->log.addSection(*command, request);
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet fuse data/vil_v102 --out map_v102\n"
      "  swiftlet fuse data/vil_v102 --trajectory run_v102/map.tum --depth stereo --out map_v102\n"
      "  swiftlet fuse data/vil_v102 --until 15 --keep v102.swm --out first\n"
      "  swiftlet fuse data/vil_v102 --from 15 --continue v102.swm --out whole");
  command->callback([options, &exit_code] { exit_code = fuse(*options); });
}

}  // namespace swiftlet
