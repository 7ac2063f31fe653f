#include "firmware_host/schedule/threaded.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <span>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

/// Longest sleep of a thread before it looks again.
constexpr Duration kLongestSleep = Duration::fromMilliseconds(5);

struct Place {
  int priority;
  int cpu;
};

Place placeOf(Rank rank, const RealtimeGroup& rt) {
  if (!rt.enabled) return {0, -1};
  switch (rank) {
    case Rank::kSensor:
      return {rt.sensor_priority, rt.sensor_cpu};
    case Rank::kPropagate:
      return {rt.propagate_priority, rt.propagate_cpu};
    case Rank::kTrack:
      return {rt.track_priority, rt.track_cpu};
    case Rank::kSmooth:
      return {rt.smooth_priority, rt.smooth_cpu};
    case Rank::kMesh:
      return {rt.mesh_priority, rt.mesh_cpu};
    case Rank::kLow:
      break;
  }
  return {rt.low_priority, rt.low_cpu};
}

class Run : public SensorSink {
 public:
  Run(SensorInput& input, Graph& graph, const ThreadedOptions& options, const RunControl& control)
      : input_(input), graph_(graph), options_(options), control_(control) {
    to_sensors_.stop = &stop_;
  }

  ThreadedReport operator()() {
    sensors_ = input_.threads(*this, to_sensors_);
    tellMembers();
    // Started from the end of the stream to its beginning, so that each node finds its readers running.
    const std::span<Node* const> nodes = graph_.nodes();
    for (auto last = nodes.rbegin(); last != nodes.rend(); ++last) {
      Node* const node = *last;
      const Place place = placeOf(node->rank(), options_.realtime);
      if (!start(
              node->name(), place, [this, node] { step(*node); }, node)) {
        node->heart().fail("cannot start the thread");
        node->abandon();
      }
    }
    for (const SensorInput::Thread& sensor : sensors_) sensing_ += sensor.level != Level::kAhead ? 1 : 0;
    for (const SensorInput::Thread& sensor : sensors_) {
      if (sensor.level == Level::kAhead) continue;
      // A thread that could not be created counts as ended.
      const Rank rank = sensor.level == Level::kSensor ? Rank::kSensor : Rank::kLow;
      const Place place = placeOf(rank, options_.realtime);
      if (start(sensor.name, place, [this, &sensor] { sense(sensor); })) continue;
      if (sensor.heart != nullptr) sensor.heart->fail("cannot start the thread");
      sensorEnded();
    }
    if (options_.started) options_.started(report_.threads);
    for (const SensorInput::Thread& sensor : sensors_) {
      if (sensor.level == Level::kAhead) start(sensor.name, {0, -1}, sensor.run);
    }
    waitForEnd();
    for (std::size_t i = 0; i < threads_.size(); ++i) join(i);
    if (!report_.left_behind) input_.finish();
    report_.finished = !control_.stopped();
    return std::move(report_);
  }

 private:
  using Level = SensorInput::Level;

  struct Thread {
    std::unique_ptr<FlightThread> thread;
    Node* node = nullptr;  ///< null: a sensor's thread
  };

  void tellMembers() {
    if (!options_.member) return;
    for (Node* node : graph_.nodes()) options_.member(node->name(), node->heart());
    for (const SensorInput::Thread& sensor : sensors_) {
      if (sensor.heart != nullptr) options_.member(sensor.name, *sensor.heart);
    }
  }

  bool start(const char* name, const Place& place, std::function<void()> entry, Node* node = nullptr) {
    ThreadSettings settings;
    settings.name = name;
    settings.priority = place.priority;
    settings.cpu = place.cpu;
    threads_.push_back({std::make_unique<FlightThread>(), node});
    report_.threads.push_back(threads_.back().thread->start(settings, std::move(entry)));
    const ThreadReport& report = report_.threads.back();
    if (!report.started) report_.faults.push_back(report.name + ": " + report.message);
    return report.started;
  }

  void join(std::size_t i) {
    FlightThread& thread = *threads_[i].thread;
    ThreadReport& report = report_.threads[i];
    if (!stop_.load()) {
      thread.join();
    } else if (!thread.joinWithin(stopped_at_ + kLongestEnd - monotonicNow())) {
      report_.left_behind = true;
      report_.faults.push_back(fmt::format("{}: did not end within {:.0f} s and was abandoned", report.name,
                                           kLongestEnd.seconds()));
      if (threads_[i].node != nullptr) threads_[i].node->leaveBehind();
      thread.abandon();
      return;
    }
    report.faults = thread.pageFaults();
    const Node* node = threads_[i].node;
    if (!thread.fault().empty()) {
      report_.faults.push_back(report.name + ": " + thread.fault());
    } else if (report.started && node != nullptr && node->wasAbandoned()) {
      report_.faults.push_back(report.name + ": ended before its work was finished");
    }
  }

  // SensorSink.

  void takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host) override {
    graph_.sensors().takeImu(sample, arrival, host);
    graph_.propagate().bell().ring();
    if (graph_.track().frames.awaitedSampleCame()) graph_.track().bell().ring();
  }

  void takeScene(const SceneImages& scene) override { graph_.sensors().takeScene(scene); }

  void takeImage(const CameraFrame& image, const HostTimes& host) override {
    graph_.sensors().takeImage(image, host);
    graph_.track().bell().ring();
  }

  void expectEnd() override {
    if (options_.expect_end) options_.expect_end();
  }

  // Threads.

  /// The input ends with its last thread, for whatever reason that thread ends.
  void sensorEnded() {
    if (sensing_.fetch_sub(1) > 1) return;
    expectEnd();
    graph_.sensors().endInput();
    graph_.sensors().wakeReaders();
  }

  void sense(const SensorInput::Thread& sensor) {
    struct AtEnd {
      Run& run;
      ~AtEnd() { run.sensorEnded(); }
    } at_end{*this};
    if (sensor.heart != nullptr) {
      runBeating(*sensor.heart, sensor.run);
    } else {
      sensor.run();
    }
  }

  void step(Node& node) {
    struct AtEnd {
      Node& node;
      ~AtEnd() {
        if (!node.done()) node.abandon();
        node.wakeReaders();
      }
    } at_end{node};
    runBeating(node.heart(), [&] {
      while (!node.done()) {
        const std::uint32_t ticket = node.bell().ticket();
        do {
          node.heart().beat();
          if (options_.before_turn && !options_.before_turn(node.name())) return;
        } while (turn(node));
        if (!node.done()) node.bell().wait(ticket, kLongestSleep);
      }
    });
  }

  static bool turn(Node& node) {
    if (!node.turn()) return false;
    node.wakeReaders();
    return true;
  }

  void waitForEnd() {
    constexpr Duration kPeriod = Duration::fromMilliseconds(20);
    constexpr int kProgressEvery = 5;
    for (int round = 0; !ended(); ++round) {
      if (!stop_.load() && (control_.stopped() || (options_.failed && options_.failed()))) {
        expectEnd();
        stopped_at_ = monotonicNow();
        stop_.store(true);
      }
      if (stop_.load()) {
        const Duration since = monotonicNow() - stopped_at_;
        if (since > kLongestEnd) return;
        if (since > kPatience) abandonStuck();
      }
      if (round % kProgressEvery == 0 && control_.progress) control_.progress(input_.taken());
      sleepFor(kPeriod);
    }
  }
  [[nodiscard]] bool ended() const {
    return sensing_.load() == 0 &&
           std::ranges::all_of(graph_.nodes(), [](const Node* node) { return node->done(); });
  }
  /// Abandons stuck nodes, so that those behind them can use the remaining time.
  void abandonStuck() {
    for (Node* node : graph_.nodes()) {
      if (!node->done() && monotonicNow() - node->heart().read().last > kStandsStill) node->abandon();
    }
  }

  /// Time after a stop request from which stuck threads are abandoned.
  static constexpr Duration kPatience = Duration::fromMilliseconds(1000);
  static constexpr Duration kStandsStill = Duration::fromMilliseconds(500);

  SensorInput& input_;
  Graph& graph_;
  const ThreadedOptions options_;
  const RunControl control_;
  RunControl to_sensors_;
  std::vector<SensorInput::Thread> sensors_;
  ThreadedReport report_;
  std::vector<Thread> threads_;
  std::atomic<int> sensing_{0};
  std::atomic<bool> stop_{false};
  Stamp stopped_at_;
};

}  // namespace

ThreadedReport runThreaded(SensorInput& input, Graph& graph, const ThreadedOptions& options,
                           const RunControl& control) {
  auto run = std::make_unique<Run>(input, graph, options, control);
  ThreadedReport report = (*run)();
  // Leaked on purpose: a stuck thread may continue at any time.
  if (report.left_behind) static_cast<void>(run.release());
  return report;
}

}  // namespace swiftlet
