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
  fmt::print("{} depth images fused ({} with labels), {} without a pose, {} refused; {} triangles\n",
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
    fmt::print(stderr, "stopped before the end; the folder holds what was done\n");
    return kExitFailed;
  }
  if (!result.has_surface) {
    fmt::print(stderr, "error: {}: no surface; summary.json says what became of the depth images\n",
               request.log);
    return kExitFailed;
  }
  return kExitDone;
}

}  // namespace

void addFuseCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("fuse", "Make the labelled map of a log with given poses");
  auto options = std::make_shared<FuseOptions>();
  FuseRequest& request = options->request;
  request.out = "fuse";
  command
      ->add_option("LOG", request.log,
                   "EuRoC/ASL folder with depth0 or two cameras, and labels0 where there are labels")
      ->required();
  command->add_option("--trajectory", request.trajectory,
                      "Poses of the body (TUM, EuRoC csv); default: the log's own truth");
  command->add_option("--out", request.out, "Folder to write")->capture_default_str();
  command->add_option("--keep", request.keep, "File to keep the map in, to be continued later");
  command
      ->add_option("--continue", request.continued,
                   "Begin with this kept map; the poses have to be in its frame")
      ->check(CLI::ExistingFile);
  addChoice<DepthSource>(
      *command, "--depth", request.depth, "Where depth comes from: sensor is the log's depth0",
      {{"any", DepthSource::kAny}, {"sensor", DepthSource::kSensor}, {"stereo", DepthSource::kStereo}});
  command
      ->add_option("--interval", request.interval,
                   "Seconds between pairs that are matched for stereo depth; pairs with labels always are")
      ->check(positive())
      ->capture_default_str();
  command
      ->add_option("--max-gap", request.max_gap,
                   "Poses are interpolated between neighbours at most this far apart [s]")
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
