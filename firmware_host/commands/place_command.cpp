#include <fmt/format.h>

#include <memory>

#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/commands/log_options.hpp"
#include "firmware_host/lab/modules/place_run.hpp"
#include "mapping/place/place_database.hpp"

namespace swiftlet {
namespace {

struct PlaceOptions {
  PlaceRequest request;
  SettingsOptions settings;
  LogCommandOptions log;
};

std::string shareText(const nlohmann::ordered_json& share) {
  return share.is_null() ? "nothing to judge" : fmt::format("{:.1f} %", 100 * share.get<double>());
}

void printPlaces(const nlohmann::ordered_json& summary) {
  const auto& retrieval = summary["retrieval"];
  fmt::print("{} keyframes of {} images, {} candidates\n",
             summary["images"]["keyframes"].get<std::uint64_t>(),
             summary["images"]["seen"].get<std::uint64_t>(), retrieval["candidates"].get<std::uint64_t>());
  fmt::print(
      "retrieval: candidates that are correct according to the poses: {}; revisiting images: {}, with their "
      "place among the candidates: {}\n",
      shareText(retrieval["precision"]), retrieval["images_revisiting"].get<std::uint64_t>(),
      shareText(retrieval["recall"]));
  if (!summary.contains("verification")) {
    fmt::print("not verified: {}\n", summary["run"]["verified"].get<bool>()
                                         ? "no candidates"
                                         : "needs a log with two cameras and their calibration");
    return;
  }
  const auto& verification = summary["verification"];
  fmt::print(
      "verified: {} loops, correct according to the poses: {}, median error {:.4f} m, {:.3f} deg; revisiting "
      "images with a loop: {}\n",
      verification["accepted"].get<std::uint64_t>(), shareText(verification["precision"]),
      verification["median_error_m"].get<double>(), verification["median_error_deg"].get<double>(),
      shareText(verification["recall"]));
}

int place(const PlaceOptions& options) {
  PlaceRequest request = options.request;
  options.log.fill(request);
  const PlaceRunResult result = runPlace(request, options.settings.read());
  printPlaces(result.summary);
  fmt::print("written to {}\n", request.out);
  if (!result.finished) {
    fmt::print(stderr, "stopped early; the folder holds the results so far\n");
    return kExitFailed;
  }
  return kExitDone;
}

}  // namespace

void addPlaceCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("place", "Recognize places in a log with given poses");
  auto options = std::make_shared<PlaceOptions>();
  PlaceRequest& request = options->request;
  request.out = "place";
  command
      ->add_option(
          "LOG", request.log,
          "EuRoC/ASL folder or an archive of one, a bag, a recorded run, or a plain folder of images")
      ->required();
  command->add_option("--trajectory", request.trajectory,
                      "Body poses (TUM, EuRoC csv). Default: the log's truth");
  command->add_option("--out", request.out, "Folder to write")->capture_default_str();
  command->add_option("--vocabulary", request.vocabulary,
                      "Vocabulary: compact, ORBvoc.txt or DBoW2 YAML (.gz). Default: loop.vocabulary");
  options->log.addCalibration(*command);
  command->add_option("--candidates", request.candidates, "Maximum number of candidates for each image")
      ->check(CLI::Range(1, static_cast<int>(kMaxPlaceCandidates)))
      ->capture_default_str();
  command->add_option("--exclude", request.exclude, "Images closer in time than this are not revisits [s]")
      ->check(nonNegative())
      ->capture_default_str();
  command->add_option("--keyframes", request.keyframes, "Maximum number of images stored")
      ->check(CLI::Range(2, 65534))
      ->capture_default_str();
  command->add_option("--max-gap", request.max_gap, "Largest gap between poses that are interpolated [s]")
      ->check(positive())
      ->capture_default_str();
  options->settings.addTo(*command);
  command->footer(
      "A plain folder of images needs --trajectory: either image names are stamps [ns], or there is one pose "
      "for each image\n"
      "in the order of names. Its candidates are not verified.\n"
      "Example:\n"
      "  swiftlet place data/vil_v102 --out place_v102\n"
      "  swiftlet place flight --trajectory run/odometry.tum --vocabulary ORBvoc.txt --out place_flight\n"
      "  swiftlet place photos --trajectory photos.tum --out place_photos");
  command->callback([options, &exit_code] { exit_code = place(*options); });
}

}  // namespace swiftlet
