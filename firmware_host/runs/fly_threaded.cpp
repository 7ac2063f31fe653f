#include "firmware_host/runs/fly_threaded.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "estimator/core/units.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/machine_report.hpp"
#include "firmware_host/realtime/memory_lock.hpp"
#include "firmware_host/runs/live_consumers.hpp"
#include "firmware_host/supervisor/supervisor.hpp"
#include "firmware_host/supervisor/systemd_notify.hpp"

namespace swiftlet {
namespace {

/// Heap for the low-priority threads: text of the log and memory of libraries.
constexpr std::size_t kHeapReserve = std::size_t{2} * 1024 * 1024;

Effort fullEffort(const Settings& settings) {
  Effort effort = settings.effort;
  effort.features = std::min(effort.features, settings.odometry.max_features);
  return effort;
}

GovernorSettings trackGovernor(const BudgetsGroup& budgets) {
  GovernorSettings governor;
  governor.step_budget = budgets.track_max_ms * kFromMs;
  governor.age_budget = (budgets.image_to_pose_wall_p99_ms - budgets.smooth_p99_ms) * kFromMs;
  return governor;
}

GovernorSettings smoothGovernor(const BudgetsGroup& budgets) {
  GovernorSettings governor;
  governor.step_budget = budgets.smooth_max_ms * kFromMs;
  governor.age_budget = budgets.image_to_pose_wall_p99_ms * kFromMs;
  return governor;
}

/// Governors of the stages whose effort the budgets govern; each is used by its stage's thread.
struct Governors {
  explicit Governors(const Settings& settings)
      : track(trackerLadder(fullEffort(settings)), trackGovernor(settings.budgets)),
        smooth(smootherLadder(fullEffort(settings)), smoothGovernor(settings.budgets)) {}
  GovernedEffort track;
  GovernedEffort smooth;
};

/// Constant facts for the supervisor, before the first message.
FlightGround groundOf(const std::vector<ThreadReport>& threads, const Calibration& calibration,
                      const Settings& settings, const FlightRequest& request) {
  FlightGround ground;
  for (const ThreadReport& thread : threads) {
    if (thread.wanted_priority == 0 && settings.realtime.enabled) continue;
    if (thread.name == "log" || thread.name == "record" || thread.name == "source") continue;
    ++ground.flight_threads;
    const bool has = thread.hasPriority() && thread.actual_policy == ThreadPolicy::kFifo;
    if (!has && ground.threads_without_priority++ == 0) {
      thread.name.copy(ground.first_without_priority.data(), ground.first_without_priority.size() - 1);
    }
  }
  ground.imu_rate = calibration.noise.rate_hz;
  ground.speed = request.speed;
  ground.host_stamps = request.host_stamps;
  ground.cameras = static_cast<int>(settings.odometry.use_stereo ? calibration.rig.camera_count : 1);
  ground.camera_rate = settings.cameras.rate_hz;
  ground.trigger = request.trigger;
  if (!settings.autopilot.device.empty()) {
    Eigen::Map<Eigen::Vector3d>(ground.vehicle_up.emplace().data()) =
        linkSettings(settings.autopilot).mounting.q_vehicle_body.conjugate() * Eigen::Vector3d::UnitZ();
  }
  return ground;
}

/// The supervisor's thread: below `track`, above `mesh`, so that low-priority work cannot silence it.
ThreadSettings supervisorThread(const RealtimeGroup& realtime) {
  ThreadSettings thread;
  thread.name = "supervisor";
  thread.priority = realtime.enabled ? (realtime.track_priority + realtime.mesh_priority) / 2 : 0;
  return thread;
}

}  // namespace

FlightEnd flyThreaded(const Calibration& calibration, SensorInput& input, const Settings& settings,
                      RunObserver& observer, GraphOptions wanted, const FlightRequest& request,
                      const RunControl& control, nlohmann::ordered_json& report) {
  const std::string confined = confineMalloc();
  const LibraryReport libraries = confineLibraries();
  const MachineReport machine = inspectMachine("", settings.realtime.sensor_priority);
  // What threads refer to; leaked if one of them is stuck at the end.
  struct Flight {
    explicit Flight(const Settings& s) : governors(s) {}
    Governors governors;
    std::unique_ptr<LiveConsumers> consumers;
    std::unique_ptr<Graph> graph;
    Supervisor supervisor;
  };
  SystemdNotify systemd;  // used when the supervisor ends
  auto flight = std::make_unique<Flight>(settings);
  Supervisor& supervisor = flight->supervisor;
  wanted.track_effort = &flight->governors.track;
  wanted.smooth_effort = &flight->governors.smooth;
  flight->consumers = std::make_unique<LiveConsumers>(calibration, settings, request);
  LiveConsumers& consumers = *flight->consumers;
  wanted.outlets = consumers.outlets();
  wanted.labels = consumers.labels();
  wanted.remarks = [&consumers, &supervisor, of_input = std::move(wanted.remarks)](RunObserver& to) {
    bool any = of_input && of_input(to);
    any = consumers.drainRemarks(to) || any;
    return supervisor.drainEvents([&to](Stamp stamp, const std::string& line) {
      to.remark(stamp, line);
      warn(line + "\n");
    }) || any;
  };
  flight->graph = std::make_unique<Graph>(calibration.rig, calibration.noise, settings, observer, wanted);
  Graph& graph = *flight->graph;
  graph.sensors().touchImages();
  reserveHeap(kHeapReserve);
  MemoryTable reserved;
  graph.addReservations(reserved);
  if (wanted.labels != nullptr) reserved.add("images to be labelled", wanted.labels->bytes());
  reserved.add("heap of the low threads", static_cast<std::int64_t>(kHeapReserve));
  MemoryLockReport lock;
  if (settings.realtime.lock_memory && settings.realtime.enabled) {
    lock = lockMemory();
  } else {
    lock.message = "disabled by realtime.lock_memory or realtime.enabled";
  }
  if (request.announce) {
    say(reserved.text());
    if (!lock.message.empty()) warn(fmt::format("warning: memory not locked: {}\n", lock.message));
  }

  consumers.addTo(supervisor);
  if (request.verdict) static_cast<void>(supervisor.addSink(request.verdict));
  ThreadedOptions options;
  options.realtime = settings.realtime;
  options.before_turn = request.before_turn;
  options.member = [&](const char* name, const Heartbeat& heart) {
    static_cast<void>(supervisor.add(name, heart));
  };
  options.expect_end = [&] { supervisor.expectEnd(); };
  std::string unsupervised;  // why there is no supervisor; empty: there is one
  options.failed = [&] { return !unsupervised.empty() || supervisor.runFailed(); };
  options.started = [&](const std::vector<ThreadReport>& threads) {
    FlightGround ground = groundOf(threads, calibration, settings, request);
    ground.memory_locked = lock.current;
    ground.recorder_wanted = request.record;
    for (const ThreadReport& thread : threads) {
      if (!request.announce || thread.message.empty()) continue;
      warn(fmt::format("warning: thread {}: {}\n", thread.name, thread.message));
    }
    const auto facts = [&](FlightFacts& out) {
      graph.look(out);
      input.look(out);
      const char* problem = request.file_problem ? request.file_problem() : nullptr;
      if (problem == nullptr) return;
      std::string_view(problem).copy(out.file_problem.data(), out.file_problem.size() - 1);
    };
    supervisor.begin(ground, facts, request.service ? &systemd : nullptr);
    const ThreadReport own = supervisor.start(supervisorThread(settings.realtime));
    if (!own.started) unsupervised = fmt::format("{}: {}; the run was stopped", own.name, own.message);
  };
  const ThreadedReport threads = runThreaded(input, graph, options, control);
  FlightEnd end{threads.finished, threads.faults.empty(), threads.left_behind};
  std::vector<std::string> faults = threads.faults;
  if (!unsupervised.empty()) faults.push_back(unsupervised);
  end.left_behind = !consumers.finish(report, faults) || end.left_behind;
  supervisor.stop();
  if (lock.current) unlockMemory();
  graph.report(observer);

  report["kind"] = "threaded";
  report["speed"] = request.speed;
  report["threads"] = nlohmann::ordered_json::array();
  for (const ThreadReport& thread : threads.threads) report["threads"].push_back(toJson(thread));
  report["thread_faults"] = faults;
  report["memory_lock"] = toJson(lock);
  report["reserved"] = reserved.json();
  report["malloc"] = confined;
  report["libraries"] = toJson(libraries);
  report["machine"] = machine.json();
  report["supervisor"] = supervisor.json();
  report["arming"] = report["supervisor"]["arming"];
  report["supervisor"].erase("arming");
  for (const std::string& fault : faults) warn(fmt::format("error: thread {}\n", fault));
  end.faultless = faults.empty();
  if (end.left_behind) static_cast<void>(flight.release());
  return end;
}

}  // namespace swiftlet
