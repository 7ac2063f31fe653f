#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "drivers/bag/bag_file.hpp"
#include "drivers/input/file_tree.hpp"
#include "drivers/input/input_error.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/evaluation/accuracy_report.hpp"
#include "firmware_host/lab/evaluation/confusion_picture.hpp"
#include "firmware_host/lab/evaluation/evaluate_meshes.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/lab/evaluation/mesh_report.hpp"
#include "firmware_host/lab/hil/hil_checks.hpp"
#include "firmware_host/outputs/run_folder/loops_csv.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/realtime/console.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

struct EvaluateOptions {
  std::string run;
  std::string truth;
  AlignKind align = AlignKind::kSe3;
  double from = 0;
  double until = -1;
  double fit_shift = 0;  ///< s; 0: no shift is fitted
  bool json = false;
  bool mesh = false;
  std::string truth_mesh;
  std::string hil;
  std::string junit;
  SettingsOptions settings;
};

/// The files to compare, and with which truth.
struct Subject {
  std::vector<std::string> files;
  std::string states;  ///< file with covariances; empty: none
  std::string truth;
  std::string log;  ///< log of the run, or log that holds the truth; empty: unknown
  std::optional<Stamp> first_image;
  Duration shift;            ///< from the files' clock to the truth's
  bool from_tracks = false;  ///< the log may be without images
};

Json readSummary(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) return nullptr;
  Json json = Json::parse(file, nullptr, false);
  if (json.is_discarded()) {
    throw InputError(path, 0, "", "not valid JSON",
                     "Replay again, or give the .tum file instead of the folder");
  }
  return json;
}

Subject subjectOf(const EvaluateOptions& options) {
  Subject subject;
  subject.truth = options.truth;
  const std::filesystem::path path(options.run);
  if (!std::filesystem::exists(path)) {
    throw InputError(options.run, 0, "", "does not exist", "Give a run folder or a trajectory file");
  }
  if (!std::filesystem::is_directory(path)) {
    subject.files.push_back(options.run);
  } else {
    for (const char* name : {"odometry.tum", "trajectory.tum", "map.tum"}) {
      if (std::filesystem::exists(path / name)) subject.files.push_back(path / name);
    }
    if (subject.files.empty()) {
      throw InputError(options.run, 0, "", "has no odometry.tum", "Give a folder written by replay or fly");
    }
    if (std::filesystem::exists(path / "states.csv")) subject.states = path / "states.csv";
    const Json summary = readSummary(path / "summary.json");
    const Json run = summary.is_object() ? summary.value("run", Json::object()) : Json::object();
    if (run.contains("first_image_ns") && run["first_image_ns"].is_number_integer()) {
      subject.first_image = Stamp{run["first_image_ns"].get<std::int64_t>()};
    }
    subject.shift = cameraToImuShift(summary);
    const bool names_log = run.contains("log") && run["log"].is_string();
    if (names_log) subject.log = run["log"].get<std::string>();
    if (subject.truth.empty() && names_log) {
      subject.truth = subject.log;
      subject.from_tracks = run.contains("tracks");
    }
  }
  if (std::filesystem::is_directory(subject.truth)) subject.log = subject.truth;
  if (subject.truth.empty()) {
    throw InputError(options.run, 0, "", "there is no truth to compare with",
                     "Give a log or a trajectory with --truth");
  }
  return subject;
}

MeshAccuracy meshAccuracy(const EvaluateOptions& options, const Subject& subject, const Truth& truth,
                          const AccuracyOptions& accuracy_options) {
  if (subject.log.empty()) {
    throw InputError(options.run, 0, "", "the log of this run is unknown", "Give the log with --truth");
  }
  return evaluateMeshes({options.run, subject.log, options.truth_mesh}, readEstimate(subject.files.front()),
                        truth.poses, accuracy_options);
}

std::string titleOf(const EvaluateOptions& options, const std::string& file) {
  std::string title = file;
  if (options.from > 0) title += fmt::format(", from {:g} s", options.from);
  if (options.until >= 0) title += fmt::format(", until {:g} s", options.until);
  return title;
}

// Compares map.tum with odometry.tum at common stamps, and reports revisits and loops.
void compareMap(const EvaluateOptions& options, const Subject& subject, const Truth& truth,
                const AccuracyOptions& accuracy_options, Json& json) {
  const std::filesystem::path run(options.run);
  if (!std::filesystem::exists(run / "map.tum") || !std::filesystem::exists(run / "odometry.tum")) return;
  const Trajectory odometry = readEstimate(run / "odometry.tum");
  const CommonStamps beside =
      compareAtCommonStamps(odometry, readEstimate(run / "map.tum"), truth.poses, accuracy_options);
  const Revisits revisits = revisitsOf(odometry, truth.poses, accuracy_options.association);
  json["map_beside_odometry"] = toJson(beside);
  json["revisits"] = toJson(revisits);
  std::string loops;
  if (std::filesystem::exists(run / "loops.csv")) {
    const LoopAccuracy accuracy =
        loopAccuracy(readLoops(run / "loops.csv"), truth.poses, accuracy_options.association);
    json["loops"] = toJson(accuracy);
    loops = titleOf(options, "loops") + "\n" + toText(accuracy);
  }
  if (options.json) return;
  fmt::print("{}, at the same stamps\n{}", subject.files.back(), toText(beside));
  fmt::print("{}\n{}{}", titleOf(options, "revisits"), toText(revisits), loops);
}

int evaluateHil(const EvaluateOptions& options) {
  const HilVerdict verdict = checkHil(readHilEvidence(options.run, options.hil));
  if (!options.junit.empty()) writeWholeFile(options.junit, verdict.junit(options.run) + "\n");
  if (options.json) {
    Json json = Json::array();
    for (const HilCheck& check : verdict.checks()) {
      json.push_back({{"name", check.name}, {"passed", check.passed}, {"says", check.says}});
    }
    fmt::print("{}\n", json.dump(2));
  } else {
    fmt::print("{}", verdict.text());
  }
  return verdict.passed() ? kExitDone : kExitFailed;
}

/// Omits poses before and after the section.
void setSection(const EvaluateOptions& options, Stamp zero, AccuracyOptions& accuracy) {
  if (options.from > 0) accuracy.association.from = zero + Duration::fromSeconds(options.from);
  if (options.until >= 0) accuracy.association.until = zero + Duration::fromSeconds(options.until);
}

int evaluatePositions(const EvaluateOptions& options, const Settings& settings, const Subject& subject) {
  LogCounters counters;
  LogWarnings warnings;
  std::vector<PositionPoint> truth = readPositions(subject.truth, counters, warnings);
  for (PositionPoint& point : truth) point.stamp = point.stamp - subject.shift;
  warnOfRows(subject.truth, counters, warnings);
  warnAll(warnings.lines());
  PositionAccuracyOptions how{accuracyOptions(settings.evaluation, options.align), std::nullopt};
  if (options.fit_shift > 0) how.reach = Duration::fromSeconds(options.fit_shift);
  Json json;
  json["truth"] = subject.truth;
  if (!options.json) fmt::print("truth: {}, positions only\n", subject.truth);
  bool compared = false;
  for (const std::string& file : subject.files) {
    LogWarnings left_out;
    const Trajectory estimate = readEstimate(file, left_out);
    warnAll(left_out.lines());
    setSection(options, subject.first_image.value_or(estimate.front().stamp), how.accuracy);
    const PositionAccuracy accuracy = positionAccuracy(estimate, truth, how);
    compared = compared || accuracy.pairs > 0;
    json[std::filesystem::path(file).filename().string()] = toJson(accuracy);
    if (!options.json) fmt::print("{}", toText(titleOf(options, file), accuracy));
  }
  if (options.json) fmt::print("{}\n", json.dump(2));
  if (!compared) {
    fmt::print(stderr,
               "error: no position of the truth has an estimate at its stamp. If its clock differs, try "
               "shifts up to S seconds with --fit-shift S\n");
  }
  return compared ? kExitDone : kExitFailed;
}

int evaluate(const EvaluateOptions& options) {
  if (!options.hil.empty()) return evaluateHil(options);
  const Settings settings = options.settings.read();
  const Subject subject = subjectOf(options);
  const bool text =
      std::filesystem::is_regular_file(subject.truth) && !isArchive(subject.truth) && !isBag(subject.truth);
  if (text && isPositionFile(subject.truth)) {
    return evaluatePositions(options, settings, subject);
  }
  if (options.fit_shift > 0) {
    throw InputError(subject.truth, 0, "--fit-shift", "applies only to a truth of positions without attitude",
                     "Omit it: poses must have stamps of the log's clock");
  }
  Truth truth = readTruth(subject.truth, subject.from_tracks);
  warnAll(truth.warnings.lines());
  truth.poses = onImageClock(std::move(truth.poses), subject.shift);
  AccuracyOptions accuracy_options = accuracyOptions(settings.evaluation, options.align);
  Json json;
  json["truth"] = truth.name;
  if (!options.json) {
    fmt::print("truth: {}{}\n", truth.name,
               subject.shift.ns == 0 ? ""
                                     : fmt::format(", at image stamps + {:.3f} ms (clock of the IMU)",
                                                   kToMs * subject.shift.seconds()));
  }
  bool compared = true;
  for (const std::string& file : subject.files) {
    LogWarnings left_out;
    const Trajectory estimate = readEstimate(file, left_out);
    warnAll(left_out.lines());
    // Without a log, time starts at the estimate's first pose.
    const Stamp zero = subject.first_image ? *subject.first_image
                       : truth.first_image ? *truth.first_image
                                           : estimate.front().stamp;
    setSection(options, zero, accuracy_options);
    const Accuracy accuracy = accuracyOf(estimate, truth.poses, accuracy_options);
    compared = compared && accuracy.pairs > 0;
    json[std::filesystem::path(file).filename().string()] = toJson(accuracy);
    if (!options.json) fmt::print("{}", toText(titleOf(options, file), accuracy));
  }
  if (compared) compareMap(options, subject, truth, accuracy_options, json);
  if (!subject.states.empty()) {
    const Consistency found = consistencyOf(subject.states, truth.poses, accuracy_options.association);
    json["consistency"] = toJson(found);
    if (!options.json) fmt::print("{}\n{}", titleOf(options, subject.states), toText(found));
  }
  if (options.mesh && compared) {
    const MeshAccuracy found = meshAccuracy(options, subject, truth, accuracy_options);
    json["mesh"] = toJson(found);
    if (!options.json) fmt::print("{}", toText(found));
    if (found.map && found.map->labels.places() > 0) {
      const std::string picture = std::filesystem::path(options.run) / "label_confusion.svg";
      writeWholeFile(picture, confusionSvg(found.map->labels, readLabelNames(subject.log)) + "\n");
      if (!options.json) fmt::print("  confusion of labels: {}\n", picture);
    }
  }
  if (options.json) fmt::print("{}\n", json.dump(2));
  if (!compared) fmt::print(stderr, "error: no pose of the estimate has a truth pose at its stamp\n");
  return compared ? kExitDone : kExitFailed;
}

}  // namespace

void addEvaluateCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("evaluate", "Compare a run or a trajectory file with the truth");
  auto options = std::make_shared<EvaluateOptions>();
  command->add_option("RUN", options->run, "Run folder or trajectory file (TUM, EuRoC csv)")->required();
  command->add_option(
      "--truth", options->truth,
      "Log, trajectory file or positions (t, x, y, z) with the truth. Default: the log of the run");
  command
      ->add_option("--fit-shift", options->fit_shift,
                   "For positions with a different clock: fit a time shift of at most this many seconds")
      ->check(nonNegative());
  addChoice<AlignKind>(*command, "--align", options->align,
                       "Alignment to the truth: sim3 includes scale; yaw aligns yaw and translation",
                       {{"se3", AlignKind::kSe3}, {"sim3", AlignKind::kSim3}, {"yaw", AlignKind::kYaw}});
  command
      ->add_option("--from", options->from, "Omit poses earlier than this many seconds after the first image")
      ->check(nonNegative());
  command
      ->add_option("--until", options->until, "Omit poses later than this many seconds after the first image")
      ->check(nonNegative());
  command->add_flag("--json", options->json, "Print only JSON on stdout");
  CLI::Option* mesh = command->add_flag(
      "--mesh", options->mesh,
      "Also compare the run's meshes with the true surface; writes label_confusion.svg to the run folder");
  command
      ->add_option("--truth-mesh", options->truth_mesh,
                   "True surface as PLY file. Default: truth/mesh.ply of the log")
      ->needs(mesh);
  CLI::Option* hil = command->add_option(
      "--hil", options->hil,
      "Check a flight on a hardware-in-the-loop replay instead; give the folder written by `swiftlet hil`");
  command->add_option("--junit", options->junit, "Also write the checks as JUnit XML")->needs(hil);
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet evaluate run_mh01 --from 3\n  swiftlet evaluate run_room --mesh\n"
      "  swiftlet evaluate flight --hil hil --junit flight.xml\n"
      "  swiftlet evaluate run_field --truth gnss.csv --align yaw --fit-shift 5\n"
      "  swiftlet evaluate trajectory.tum --truth data/euroc_mh01_20s --align yaw");
  command->callback([options, &exit_code] { exit_code = evaluate(*options); });
}

}  // namespace swiftlet
