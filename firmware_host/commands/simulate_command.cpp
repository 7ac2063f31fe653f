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
  command.add_option(
      "--board", options.board,
      "A calibration session in place of a flight: a hand moves the rig in front of this board "
      "(Kalibr's target YAML)");
  command.add_flag("--calibrated", options.session.calibrated,
                   "Of a session: leave the cameras' true calibration in the log");
  addChoice<Turning>(command, "--turning", options.session.session.turning,
                     "Of a session: how the hand turns the rig; the last two are mistakes",
                     {{"all", Turning::kAll}, {"no_roll", Turning::kNoRoll}, {"none", Turning::kNone}});
  command.add_option("--lens-blur", options.session.lens_blur, "Of a session: of both lenses, 1 sigma [px]")
      ->check(range(0.0, 20.0))
      ->capture_default_str();
}

int simulate(const SimulateOptions& options) {
  static_cast<void>(options.settings.read());  // complains about wrong settings as every command does
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
    throw InputError("simulate", 0, "", message.empty() ? status.what : message,
                     "`swiftlet simulate --help` lists what can be asked for");
  }
  fmt::print("written to {}\n", options.out);
  return kExitDone;
}

void addFlightOptions(CLI::App& command, SimulationSettings& s) {
  command.add_option("--duration", s.flight.duration, "Length of the flight [s]")
      ->check(positive())
      ->capture_default_str();
  command.add_option("--seed", s.seed, "Of everything random: same seed, same bytes")->capture_default_str();
  command.add_option("--world-seed", s.world_seed,
                     "Seed of the world alone, for several flights in one world. 0: same as --seed");
  addChoice<WorldKind>(command, "--world", s.world.kind, "Where to fly",
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
                  "Seed of a random rig: lenses, poses, IMU matrices and noise, time shift, shutter")
      ->capture_default_str();
  command.add_option("--speed", s.flight.speed, "Mean speed [m/s]")->check(positive())->capture_default_str();
  command.add_option("--aggressiveness", s.flight.aggressiveness, "0 calm, 1 usual, 2 fast")
      ->check(range(0.0, 4.0))
      ->capture_default_str();
  command.add_option("--rest-at-start", s.flight.rest_at_start, "At rest before the flight [s]")
      ->check(nonNegative())
      ->capture_default_str();
  command.add_option("--motion", s.given_motion, "EuRoC ground truth to fly (data.csv or data.csv.xz)");
  command.add_option(
      "--world-for", s.world_for,
      "Motions that the world is made to fit, instead of this flight's own. Flights in one world "
      "need the same list and the same --world-seed");
  command.add_option("--motion-skip", s.motion_skip, "Leave out its first seconds [s]")->check(nonNegative());
}

}  // namespace

void addSimulateCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand(
      "simulate", "Make a flight, or a calibration session, with exact truth, as an EuRoC folder");
  auto options = std::make_shared<SimulateOptions>();
  SimulationSettings& simulation = options->simulation;
  command->add_option("--out", options->out, "Folder to write")->capture_default_str();
  addFlightOptions(*command, simulation);
  addSessionOptions(*command, *options);
  command->add_option("--rate", simulation.camera_rate, "Images a second [Hz]")
      ->check(range(1.0, 200.0))
      ->capture_default_str();
  command->add_flag("--mono", simulation.mono, "Camera 0 alone");
  command->add_flag("--low-light", simulation.low_light, "A dim room: 5 % of the light, longer exposure");
  addChoice<ExposureMode>(
      *command, "--exposure-control", simulation.exposure_mode,
      "Gain that follows the light at once; the control that flies on vehicles, in the loop; or neither",
      {{"gain", ExposureMode::kGain},
       {"odometry", ExposureMode::kOdometry},
       {"fixed", ExposureMode::kFixed}});
  command->add_option("--light-change", options->light,
                      "START LEVEL: from START [s] on the light goes to LEVEL times the flight's first, "
                      "within 2 s; may be repeated");
  command->add_flag("--png", options->png, "PNG images in place of JPEG");
  command->add_flag("--tracks", options->tracks, "Feature tracks in place of images, depth and labels");
  command
      ->add_option("--depth-every", simulation.depth_every, "Depth and labels at every n-th image; 0: none")
      ->check(nonNegative())
      ->capture_default_str();
  command->add_option("--vibration", options->vibration, "Motor vibration, 80 to 150 Hz [m/s^2]")
      ->check(nonNegative());
  command
      ->add_option("--readout", options->readout_ms, "Rolling shutter: from the first row to the last [ms]")
      ->check(range(0.0, 100.0));
  command->add_option("--stamp-offset", options->stamp_offset_ms, "Added to the image stamps [ms]");
  command->add_option("--blackout", options->blackout, "Dark images: START SECONDS")->expected(2);
  command->add_option("--camera-missing", options->camera_missing, "No images of camera 1: START SECONDS")
      ->expected(2);
  command->add_option("--imu-gap", options->imu_gap, "No IMU samples: START SECONDS")->expected(2);
  command->add_option("--threads", simulation.threads, "Threads that render")
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
