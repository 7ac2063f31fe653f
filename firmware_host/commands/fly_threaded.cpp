#include "firmware_host/commands/fly_threaded.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "firmware_host/commands/live_consumers.hpp"
#include "firmware_host/pipeline/arming_monitor.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/machine_report.hpp"
#include "firmware_host/realtime/memory_lock.hpp"

namespace swiftlet {
namespace {

constexpr double kMilli = 1e-3;
/// What the low-priority threads work with: text of the log, the libraries' own.
constexpr std::size_t kHeapReserve = std::size_t{2} * 1024 * 1024;

Effort fullEffort(const Settings& settings) {
  Effort effort = settings.effort;
  effort.features = std::min(effort.features, settings.odometry.max_features);
  return effort;
}

GovernorSettings trackGovernor(const BudgetsGroup& budgets) {
  GovernorSettings governor;
  governor.step_budget = budgets.track_max_ms * kMilli;
  governor.age_budget = (budgets.image_to_pose_wall_p99_ms - budgets.smooth_p99_ms) * kMilli;
  return governor;
}

GovernorSettings smoothGovernor(const BudgetsGroup& budgets) {
  GovernorSettings governor;
  governor.step_budget = budgets.smooth_max_ms * kMilli;
  governor.age_budget = budgets.image_to_pose_wall_p99_ms * kMilli;
  return governor;
}

/// Governed where the budgets say so; the thread that gives effort owns its governor.
struct Governors {
  explicit Governors(const Settings& settings)
      : track(trackerLadder(fullEffort(settings)), trackGovernor(settings.budgets)),
        smooth(smootherLadder(fullEffort(settings)), smoothGovernor(settings.budgets)) {}
  GovernedEffort track;
  GovernedEffort smooth;
};

}  // namespace

bool flyThreaded(const Calibration& calibration, SensorInput& input, const Settings& settings, RunLog& log,
                 Wiring::Options wanted, const FlightRequest& request, const RunControl& control,
                 nlohmann::ordered_json& report) {
  const std::string confined = confineMalloc();
  const LibraryReport libraries = confineLibraries();
  const MachineReport machine = inspectMachine("", settings.realtime.sensor_priority);
  Governors governors(settings);
  ArmingMonitor arming;
  wanted.track_effort = &governors.track;
  wanted.smooth_effort = &governors.smooth;
  wanted.arming = &arming;
  LiveConsumers consumers(calibration, settings, request);
  wanted.outlets = consumers.outlets();
  wanted.labels = consumers.labels();
  wanted.remarks = [&consumers, of_input = std::move(wanted.remarks)](RunLog& to) {
    const bool any = of_input && of_input(to);
    return consumers.drainRemarks(to) || any;
  };
  const auto wiring = std::make_unique<Wiring>(calibration.rig, calibration.noise, settings, log, wanted);
  reserveHeap(kHeapReserve);
  MemoryTable reserved;
  wiring->addReservations(reserved);
  if (wanted.labels != nullptr) reserved.add("images to be labelled", wanted.labels->bytes());
  reserved.add("heap of the low threads", static_cast<std::int64_t>(kHeapReserve));
  MemoryLockReport lock;
  if (settings.realtime.lock_memory && settings.realtime.enabled) {
    lock = lockMemory();
  } else {
    lock.message = "switched off by realtime.lock_memory or realtime.enabled";
  }
  if (request.announce) {
    say(reserved.text());
    if (!lock.message.empty()) warn(fmt::format("warning: memory not locked: {}\n", lock.message));
  }

  ThreadedOptions options;
  options.realtime = settings.realtime;
  options.started = [&](const std::vector<ThreadReport>& threads) {
    ArmingGround ground;
    for (const ThreadReport& thread : threads) {
      if (thread.wanted_priority == 0 && settings.realtime.enabled) continue;
      if (thread.name == "log" || thread.name == "record" || thread.name == "source") continue;
      ++ground.flight_threads;
      const bool has = thread.hasPriority() && thread.actual_policy == ThreadPolicy::kFifo;
      if (!has && ground.threads_without_priority++ == 0) ground.first_without_priority = thread.name;
      if (request.announce && !thread.message.empty()) {
        warn(fmt::format("warning: thread {}: {}\n", thread.name, thread.message));
      }
    }
    ground.memory_locked = lock.current;
    ground.imu_rate = calibration.noise.rate_hz;
    ground.speed = request.speed;
    ground.cameras = static_cast<int>(settings.odometry.use_stereo ? calibration.rig.camera_count : 1);
    ground.recorder_wanted = wanted.recorder != nullptr;
    arming.begin(ground);
  };
  const ThreadedReport threads = runThreaded(input, *wiring, options, control);
  consumers.finish(report);
  if (lock.current) unlockMemory();
  log.collect(*wiring);

  report["kind"] = "threaded";
  report["speed"] = request.speed;
  report["threads"] = nlohmann::ordered_json::array();
  for (const ThreadReport& thread : threads.threads) report["threads"].push_back(toJson(thread));
  report["thread_faults"] = threads.faults;
  report["memory_lock"] = toJson(lock);
  report["reserved"] = reserved.json();
  report["malloc"] = confined;
  report["libraries"] = toJson(libraries);
  report["machine"] = machine.json();
  report["arming"] = toJson(arming.verdict());
  report["arming"]["first_ready_ns"] =
      arming.firstReady() ? nlohmann::ordered_json(arming.firstReady()->ns) : nlohmann::ordered_json(nullptr);
  for (const std::string& fault : threads.faults) warn(fmt::format("error: thread {}\n", fault));
  return threads.finished && threads.faults.empty();
}

}  // namespace swiftlet
