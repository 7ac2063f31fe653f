#include "firmware_host/commands/fly_run.hpp"

#include <atomic>
#include <ctime>
#include <memory>
#include <optional>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/commands/confusion_file.hpp"
#include "firmware_host/commands/fly_threaded.hpp"
#include "firmware_host/commands/moving_labels.hpp"
#include "firmware_host/commands/run_output.hpp"
#include "firmware_host/live/live_input.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/report/run_claim.hpp"

namespace swiftlet {
namespace {

/// Longer than an IMU's samples take over any of the links: their buffers hold 16 ms at the most.
constexpr Duration kSamplePatience = Duration::fromMilliseconds(25);
constexpr const char* kHungUp =
    "terminal closed (SIGHUP): the flight goes on; end it with SIGINT or SIGTERM (`pkill -INT swiftlet`)";

/// The run folder; empty where there is none to be had.
std::string claimFolder(const FlyRequest& request, const Settings& settings, std::optional<RunClaim>& claim,
                        LostFiles& lost) {
  try {
    std::string out = request.out;
    if (out.empty()) {
      out = makeFlightFolder(settings.flights.folder, std::time(nullptr));
      constexpr std::uint64_t kMebibyte = std::uint64_t{1} << 20U;
      const std::uint64_t keep = kMebibyte * static_cast<std::uint64_t>(settings.flights.keep_free_mib);
      for (const std::string& line : freeOldFlights(settings.flights.folder, keep, out)) {
        warn(line + "\n");
      }
    }
    claim.emplace(out, RunKind::kFlight, true);
    return out;
  } catch (const InputError& error) {
    lost.add(fmt::format("{}: no folder for this flight", error.what()));
    return {};
  }
}

}  // namespace

Calibration vehicleCalibration(const Settings& settings) {
  if (settings.vehicle.calibration.empty()) {
    throw InputError("settings", 0, "vehicle.calibration",
                     "the settings do not say how the rig is calibrated",
                     "Name a folder with EuRoC's sensor.yaml files, or Kalibr's camchain");
  }
  CalibrationOptions options;
  options.accept_unusual_rig = settings.calibration.accept_unusual_rig;
  return readCalibration(settings.vehicle.calibration, settings.vehicle.imu_calibration, options);
}

FlyResult runFlight(const FlyRequest& request, Settings settings) {
  if (request.loop_closure) settings.loop.enabled = true;
  if (request.map) settings.map.enabled = true;
  checkMovingLabels(settings.map_stage);
  // A mistake that the user can correct, unlike a broken disk.
  if (!request.out.empty() && !request.replace) refuseRunIn(request.out);
  const Calibration calibration = vehicleCalibration(settings);
  for (const std::string& line : calibration.warnings) warn("warning: " + line + "\n");
  MemoryTrack memory;
  LiveInput input(settings, calibration);
  LiveInput::Opened opened = input.open();
  for (const std::string& line : opened.warnings) warn("warning: " + line + "\n");
  FlyResult result;
  if (!opened.faults.empty()) {
    result.missing = std::move(opened.faults);
    return result;
  }
  memory.note("devices");

  LostFiles lost;
  std::optional<RunClaim> claim;
  result.out = claimFolder(request, settings, claim, lost);
  RunOutput output(result.out, settings, calibration, RunOutput::Wanted{request.imu_rate, false, true}, lost);
  std::unique_ptr<FlightRecorder> recorder;
  if (request.record) recorder = output.startRecorder(RecordOrder::kByArrival);
  Wiring::Options wanted = output.wiringOptions();
  wanted.recorder = recorder.get();
  wanted.confusion = confusionOf(settings);
  wanted.sample_patience = kSamplePatience;
  wanted.remarks = [&input, &request](RunLog& log) {
    const auto remark = [&log](Stamp stamp, const std::string& line) {
      log.remark(stamp, line);
      warn(line + "\n");
    };
    const bool hung_up = request.hung_up != nullptr && request.hung_up->exchange(false);
    if (hung_up) remark(monotonicNow(), kHungUp);
    return input.drainEvents(remark) || hung_up;
  };
  // The executor asks ten times a second.
  std::atomic<bool> stop{false};
  RunControl control;
  control.stop = &stop;
  const double begin = wallSeconds();
  control.progress = [&](std::uint64_t /*images*/) {
    const bool told = request.stop != nullptr && request.stop->load(std::memory_order_relaxed);
    if (told || (request.seconds > 0 && wallSeconds() - begin > request.seconds)) stop.store(true);
  };
  FlightRequest flight;
  flight.announce = request.show_progress;
  flight.host_stamps = true;
  flight.name = "flight";
  flight.view = request.view;
  RunFacts facts;
  const double cpu = processCpuSeconds();
  flyThreaded(calibration, input, settings, output.log(), wanted, flight, control, facts.executor);
  // A flight has no end of its own: to be told is its end.
  facts.finished = true;
  facts.wall = wallSeconds() - begin;
  facts.cpu = processCpuSeconds() - cpu;
  memory.note("grown_in_flight");
  facts.mono = !settings.odometry.use_stereo || calibration.rig.camera_count < 2;
  facts.memory = memory.rows();
  facts.calibration_form = calibration.form;
  facts.input["devices"] = input.counters();
  if (recorder) {
    facts.executor["recording"] = recordingJson(*recorder);
    if (!recorder->status().ok())
      lost.add(fmt::format("{}/recording: {}", result.out, recorder->status().what));
  }
  output.close(facts);
  result.summary = output.summary(facts);
  output.writeSummary(result.summary);
  if (settings.flights.smooth && output.canSmooth()) {
    output.smooth(request.renew_stop ? request.renew_stop() : nullptr, request.show_progress);
    result.summary = output.summary(facts);
    output.writeSummary(result.summary);
  }
  if (const char* problem = lost.problem()) result.lost = problem;
  result.has_pose = output.log().statistics().first_pose.has_value();
  return result;
}

}  // namespace swiftlet
