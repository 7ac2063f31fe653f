#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/track_file.hpp"
#include "drivers/simulated/folder_writer.hpp"
#include "drivers/simulated/session_folder.hpp"
#include "drivers/target/target_file.hpp"
#include "firmware_host/commands/checks.hpp"
#include "firmware_host/commands/command.hpp"
#include "firmware_host/realtime/progress.hpp"

namespace swiftlet {
namespace {

struct SimulateOptions {
  SimulationSettings simulation;
  SettingsOptions settings;
  std::string out = "flight";
  double vibration = 0;
  double readout_ms = 0;
  double stamp_offset_ms = 0;
  std::vector<double> blackout;
  std::vector<double> camera_missing;
  std::vector<double> imu_gap;
  std::vector<std::pair<double, double>> light;
  bool tracks = false;
  bool png = false;
  std::string board;
  SessionFolderSettings session;
};

void addFault(std::vector<Fault>& faults, FaultKind kind, const std::vector<double>& span, int camera) {
  if (span.size() == 2) faults.push_back({kind, {span[0], span[0] + span[1]}, camera});
}

Status simulateTracks(const SimulationSettings& settings, const std::string& folder,
                      const SimulationProgress& progress, std::string& message) {
  const std::filesystem::path place = std::filesystem::path(folder) / "mav0" / "tracks0";
  std::unique_ptr<TrackWriter> writer;
  const Status status = simulateTracksToFolder(
      settings, folder,
      [&](const TrackedFrame& frame) {
        if (!writer) {
          std::filesystem::create_directories(place);
          writer = std::make_unique<TrackWriter>((place / "data.csv").string());
        }
        writer->write(frame);
      },
      progress, &message);
  if (writer) writer->close();
  return status;
}

Status simulateSession(const SimulateOptions& options, const SimulationSettings& flight,
                       const SimulationProgress& progress, std::string& message) {
  SessionFolderSettings session = options.session;
  session.rig = flight.rig;
  session.rig_seed = flight.rig_seed;
  session.mono = flight.mono;
  session.image_stamp_offset = flight.image_stamp_offset;
  session.readout = Duration::fromSeconds(flight.render.readout);
  session.session.seed = flight.seed;
  session.session.duration = flight.flight.duration;
  session.session.camera_rate = flight.camera_rate;
  if (flight.flight.rest_at_start > 0) session.session.rests.push_back({0, flight.flight.rest_at_start});
  session.format = flight.format;
  session.threads = flight.threads;
  return simulateSessionToFolder(readTarget(options.board), session, options.out, progress, &message);
}

void addSessionOptions(CLI::App& command, SimulateOptions& options) {
  command.add_option("--board", options.board,
                     "Simulate a calibration session instead of a flight: a hand moves the rig in front of "
                     "this board (Kalibr's target YAML)");
  command.add_flag("--calibrated", options.session.calibrated,
                   "Session: write the cameras' true calibration to the log");
  addChoice<Turning>(command, "--turning", options.session.session.turning,
                     "Session: motion of the rig; the last two are typical mistakes",
                     {{"all", Turning::kAll}, {"no_roll", Turning::kNoRoll}, {"none", Turning::kNone}});
  command
      .add_option("--lens-blur", options.session.lens_blur,
                  "Session: blur of both lenses, standard deviation [px]")
      ->check(range(0.0, 20.0))
      ->capture_default_str();
}

void refuseRealLog(const std::filesystem::path& folder) {
  using std::filesystem::exists;
  const bool simulated = exists(folder / "truth/simulation.yaml") || exists(folder / "truth/session.yaml");
  if (simulated || !exists(folder / "mav0")) return;
  throw InputError(folder.string(), 0, "--out", "already holds a log that was not simulated",
                   "Give another --out, or move the log away");
}

int simulate(const SimulateOptions& options) {
  static_cast<void>(options.settings.read());  // reports wrong settings as every command does
  refuseRealLog(options.out);
  SimulationSettings settings = options.simulation;
  settings.imu.vibration.accel_amplitude = options.vibration;
  settings.render.readout = options.readout_ms * 1e-3;
  settings.image_stamp_offset = Duration::fromSeconds(options.stamp_offset_ms * 1e-3);
  settings.format = options.png ? ImageFormat::kPng : ImageFormat::kJpeg;
  for (const auto& [begin, level] : options.light) settings.light_changes.push_back({begin, level});
  addFault(settings.faults, FaultKind::kBlackout, options.blackout, -1);
  addFault(settings.faults, FaultKind::kCameraMissing, options.camera_missing, 1);
  addFault(settings.faults, FaultKind::kImuGap, options.imu_gap, -1);

  std::unique_ptr<Progress> progress;
  std::string message;
  const SimulationProgress show = [&](int done, int total) {
    if (!progress) progress = std::make_unique<Progress>("simulate", static_cast<std::uint64_t>(total));
    progress->update(static_cast<std::uint64_t>(done));
  };
  Status status;
  if (!options.board.empty()) {
    status = simulateSession(options, settings, show, message);
  } else if (options.tracks) {
    status = simulateTracks(settings, options.out, show, message);
  } else {
    status = simulateToFolder(settings, options.out, show, &message);
  }
  if (progress) progress->finish();
  if (!status.ok()) {
    const char* remedy =
        status.code == StatusCode::kInvalidInput
            ? "`swiftlet simulate --help` lists the choices"
            : "Check that this path can be read or written and the disk is not full, or give another --out";
    throw InputError("simulate", 0, "", message.empty() ? status.what : message, remedy);
  }
  fmt::print("written to {}\n", options.out);
  return kExitDone;
}

void addFlightOptions(CLI::App& command, SimulationSettings& s) {
  command.add_option("--duration", s.flight.duration, "Length of the flight [s]")
      ->check(positive())
      ->capture_default_str();
  command.add_option("--seed", s.seed, "Seed of everything random; the same seed gives the same bytes")
      ->capture_default_str();
  command.add_option("--world-seed", s.world_seed,
                     "Seed of the world, to fly several times in one world. 0: same as --seed");
  addChoice<WorldKind>(command, "--world", s.world.kind, "World to fly in",
                       {{"room", WorldKind::kRoom},
                        {"hall", WorldKind::kHall},
                        {"cluttered", WorldKind::kCluttered},
                        {"twin_rooms", WorldKind::kTwinRooms},
                        {"corridor", WorldKind::kCorridor}});
  addChoice<RigKind>(command, "--rig", s.rig, "Cameras and IMU",
                     {{"euroc", RigKind::kEuroc},
                      {"forward", RigKind::kForward},
                      {"wide", RigKind::kWide},
                      {"fisheye", RigKind::kFisheye},
                      {"random_pinhole", RigKind::kRandomPinhole},
                      {"random_fisheye", RigKind::kRandomFisheye}});
  command
      .add_option("--rig-seed", s.rig_seed,
                  "Seed of a random rig: lenses, poses, IMU matrices and noise, time offset, shutter")
      ->capture_default_str();
  command.add_option("--speed", s.flight.speed, "Mean speed [m/s]")->check(positive())->capture_default_str();
  command
      .add_option("--aggressiveness", s.flight.aggressiveness,
                  "Aggressiveness of the motion: 0 calm, 1 usual, 2 fast")
      ->check(range(0.0, 4.0))
      ->capture_default_str();
  command.add_option("--rest-at-start", s.flight.rest_at_start, "Time at rest before the flight [s]")
      ->check(nonNegative())
      ->capture_default_str();
  command.add_option("--motion", s.given_motion, "EuRoC ground truth to fly (data.csv or data.csv.xz)");
  command.add_option("--world-for", s.world_for,
                     "Motion files that the world must fit, instead of this flight's own motion. Flights in "
                     "one world need the same list and the same --world-seed");
  command.add_option("--motion-skip", s.motion_skip, "Seconds to skip at the start of --motion [s]")
      ->check(nonNegative());
}

}  // namespace

void addSimulateCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand(
      "simulate", "Simulate a flight or a calibration session with exact truth, as a EuRoC folder");
  auto options = std::make_shared<SimulateOptions>();
  SimulationSettings& simulation = options->simulation;
  const CLI::Validator seconds = range(0.0, 86400.0);
  command->add_option("--out", options->out, "Folder to write")->capture_default_str();
  addFlightOptions(*command, simulation);
  addSessionOptions(*command, *options);
  command->add_option("--rate", simulation.camera_rate, "Frame rate [Hz]")
      ->check(range(1.0, 200.0))
      ->capture_default_str();
  command->add_flag("--mono", simulation.mono, "Write camera 0 only");
  command->add_flag("--low-light", simulation.low_light, "Dark room: 5 % of the light, longer exposure");
  addChoice<ExposureMode>(*command, "--exposure-control", simulation.exposure_mode,
                          "Exposure control: instant gain, the control that vehicles use, or none",
                          {{"gain", ExposureMode::kGain},
                           {"odometry", ExposureMode::kOdometry},
                           {"fixed", ExposureMode::kFixed}});
  command->add_option("--light-change", options->light,
                      "START LEVEL: from START [s] on, the light changes to LEVEL times its first value, "
                      "within 2 s; may be repeated");
  command->add_flag("--png", options->png, "Write PNG images instead of JPEG");
  command->add_flag("--tracks", options->tracks, "Write feature tracks instead of images, depth and labels")
      ->excludes(command->get_option("--board"));
  command
      ->add_option("--depth-every", simulation.depth_every,
                   "Write depth and labels for every n-th image; 0: none")
      ->check(nonNegative())
      ->capture_default_str();
  command
      ->add_option("--vibration", options->vibration,
                   "Amplitude of the motor vibration, 80 to 150 Hz [m/s^2]")
      ->check(nonNegative());
  command
      ->add_option("--readout", options->readout_ms,
                   "Readout time of a rolling shutter, first to last row [ms]")
      ->check(range(0.0, 100.0));
  command->add_option("--stamp-offset", options->stamp_offset_ms, "Offset added to the image stamps [ms]")
      ->check(range(-1000.0, 1000.0));
  command->add_option("--blackout", options->blackout, "Blackout of the images: START SECONDS")
      ->expected(2)
      ->check(seconds);
  command->add_option("--camera-missing", options->camera_missing, "Dropout of camera 1: START SECONDS")
      ->expected(2)
      ->check(seconds);
  command->add_option("--imu-gap", options->imu_gap, "Dropout of the IMU: START SECONDS")
      ->expected(2)
      ->check(seconds);
  command->add_option("--threads", simulation.threads, "Number of rendering threads")
      ->check(range(1, 64))
      ->capture_default_str();
  options->settings.addTo(*command);
  command->footer(
      "Example:\n  swiftlet simulate --duration 20 --seed 7 --out flight\n"
      "  swiftlet simulate --world hall --rig fisheye --imu-gap 8 1 --out hard_flight\n"
      "  swiftlet simulate --board board.yaml --rig random_pinhole --rig-seed 3 --out session");
  command->callback([options, &exit_code] { exit_code = simulate(*options); });
}

}  // namespace swiftlet
