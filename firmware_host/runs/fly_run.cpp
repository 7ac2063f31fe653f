#include "firmware_host/runs/fly_run.hpp"

#include <fmt/format.h>

#include <atomic>
#include <ctime>
#include <memory>
#include <optional>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/inputs/devices/live_input.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/runs/fly_threaded.hpp"
#include "firmware_host/runs/run_output.hpp"
#include "firmware_host/runs/vehicle_calibration.hpp"
#include "firmware_host/settings/map_check.hpp"

namespace swiftlet {
namespace {

constexpr const char* kHungUp =
    "terminal closed (SIGHUP): the flight continues; stop it with SIGINT or SIGTERM (`pkill -INT swiftlet`)";

/// Claims the run folder; empty if none can be claimed.
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
    lost.add(fmt::format("{}: this flight has no folder", error.what()));
    return {};
  }
}

/// The parts of a flight. Threads refer to all of them.
class FlightRun {
 public:
  FlightRun(const FlyRequest& request, Settings settings)
      : request_(request),
        settings_(std::move(settings)),
        calibration_(vehicleCalibration(settings_)),
        input_(settings_, calibration_) {}

  FlyResult operator()() {
    for (const std::string& line : calibration_.warnings) warn("warning: " + line + "\n");
    LiveInput::Opened opened = input_.open();
    for (const std::string& line : opened.warnings) warn("warning: " + line + "\n");
    if (!opened.faults.empty()) {
      result_.missing = std::move(opened.faults);
      return result_;
    }
    memory_.note("devices");
    RunInputs inputs = readRunInputs(settings_, request_.kept_maps.keep);
    result_.out = claimFolder(request_, settings_, claim_, lost_);
    output_.emplace(result_.out, settings_, calibration_,
                    RunOutput::Wanted{request_.imu_rate, false, request_.kept_maps.keep, true},
                    std::move(inputs), lost_);
    if (request_.record) recorder_ = output_->startRecorder(RecordOrder::kByArrival);
    fly();
    end();
    return result_;
  }

 private:
  void fly() {
    if (const std::string line = settings_.map.enabled ? nearDepthWarning(calibration_.rig) : "";
        !line.empty()) {
      warn("warning: " + line + "\n");
      facts_.warnings.push_back(line);
    }
    GraphOptions wanted = output_->graphOptions();
    wanted.recorder = recorder_.get();
    wanted.sample_patience = input_.samplePatience();
    wanted.remarks = [this](RunObserver& observer) { return remark(observer); };
    // The schedule calls this ten times a second.
    const double begin = wallSeconds();
    const double cpu = processCpuSeconds();
    RunControl control;
    control.stop = &stop_;
    control.progress = [&](std::uint64_t /*images*/) {
      const bool told = request_.stop != nullptr && request_.stop->load(std::memory_order_relaxed);
      if (told || (request_.seconds > 0 && wallSeconds() - begin > request_.seconds)) stop_.store(true);
    };
    FlightRequest flight;
    flight.announce = request_.show_progress;
    flight.host_stamps = true;
    flight.service = true;
    flight.record = request_.record;
    flight.trigger = input_.hasTrigger();
    flight.name = "flight";
    flight.autopilot_outbox = input_.outbox();
    flight.view = request_.view;
    flight.file_problem = [this] { return lost_.problem(); };
    const FlightEnd flown = flyThreaded(calibration_, input_, settings_, output_->observer(), wanted, flight,
                                        control, facts_.executor);
    result_.faultless = flown.faultless;
    result_.left_behind = flown.left_behind;
    // A flight ends only by request, so a requested end counts as finished.
    facts_.finished = flown.faultless;
    facts_.wall = wallSeconds() - begin;
    facts_.cpu = processCpuSeconds() - cpu;
  }

  /// Remarks of the input and of the terminal, on the thread `log`.
  bool remark(RunObserver& observer) {
    const auto tell = [&observer](Stamp stamp, const std::string& line) {
      observer.remark(stamp, line);
      warn(line + "\n");
    };
    const bool hung_up = request_.hung_up != nullptr && request_.hung_up->exchange(false);
    if (hung_up) tell(monotonicNow(), kHungUp);
    return input_.drainEvents(tell) || hung_up;
  }

  void end() {
    memory_.note("grown_in_flight");
    facts_.mono = !settings_.odometry.use_stereo || calibration_.rig.camera_count < 2;
    facts_.memory = memory_.rows();
    facts_.calibration_form = calibration_.form;
    facts_.input["devices"] = input_.counters();
    if (recorder_) {
      facts_.executor["recording"] = recordingJson(*recorder_);
      if (!recorder_->status().ok()) {
        lost_.add(fmt::format("{}/recording: {}", result_.out, recorder_->status().what));
      }
    }
    output_->close(facts_);
    writeSummary();
    if (settings_.flights.smooth && output_->canSmooth()) {
      output_->smooth(request_.renew_stop ? request_.renew_stop() : nullptr, request_.show_progress);
      writeSummary();
    }
    if (const char* problem = lost_.problem()) result_.lost = problem;
    result_.has_pose = output_->observer().statistics().first_pose.has_value();
  }

  void writeSummary() {
    result_.summary = output_->summary(facts_);
    output_->writeSummary(result_.summary);
  }

  const FlyRequest request_;
  MemoryTrack memory_;
  const Settings settings_;
  const Calibration calibration_;
  LiveInput input_;
  LostFiles lost_;
  std::optional<RunClaim> claim_;
  std::optional<RunOutput> output_;
  std::unique_ptr<FlightRecorder> recorder_;
  std::atomic<bool> stop_{false};
  RunFacts facts_;
  FlyResult result_;
};

}  // namespace

FlyResult runFlight(const FlyRequest& request, Settings settings) {
  if (request.loop_closure) settings.loop.enabled = true;
  request.kept_maps.apply(settings);
  if (request.map) settings.map.enabled = true;
  checkMapSettings(settings.map_stage);
  // The user can correct this mistake, unlike a broken disk.
  if (!request.out.empty() && !request.replace) refuseRunIn(request.out);
  auto run = std::make_unique<FlightRun>(request, std::move(settings));
  FlyResult result = (*run)();
  // Leaked on purpose: a stuck thread may continue at any time.
  if (result.left_behind) static_cast<void>(run.release());
  return result;
}

}  // namespace swiftlet
