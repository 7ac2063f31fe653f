#include "firmware_host/pipeline/threaded.hpp"

#include <memory>

#include "firmware_host/pipeline/host_sleep.hpp"
#include "firmware_host/realtime/doorbell.hpp"

namespace swiftlet {
namespace {

/// Nobody on the flight path sleeps longer without a look.
constexpr Duration kLongestSleep = Duration::fromMilliseconds(5);
/// How often the low threads look: the recorder's and the log's arrows hold many times as much.
constexpr Duration kLowPeriod = Duration::fromMilliseconds(5);

class Run : public SensorSink {
 public:
  Run(SensorInput& input, Wiring& wiring, const ThreadedOptions& options, const RunControl& control)
      : input_(input), wiring_(wiring), options_(options), control_(control) {}

  ThreadedReport operator()() {
    const RealtimeGroup& rt = options_.realtime;
    // From the end of the stream to its beginning: whoever starts finds its readers running.
    start("log", rt.low_priority, rt.low_cpu, [this] { low([this] { return wiring_.log(); }, log_done_); });
    start("record", rt.low_priority, rt.low_cpu,
          [this] { low([this] { return wiring_.record(); }, record_done_); });
    start("map", rt.low_priority, rt.low_cpu, [this] { map(); });
    start("loop", rt.low_priority, rt.low_cpu, [this] { loop(); });
    start("mesh", rt.mesh_priority, rt.mesh_cpu, [this] { mesh(); });
    start("smooth", rt.smooth_priority, rt.smooth_cpu, [this] { smooth(); });
    start("track", rt.track_priority, rt.track_cpu, [this] { track(); });
    start("propagate", rt.propagate_priority, rt.propagate_cpu, [this] { propagate(); });
    const std::vector<SensorInput::Thread> sensors = input_.threads(*this, control_);
    for (const SensorInput::Thread& sensor : sensors) sensing_ += sensor.of_vehicle ? 1 : 0;
    for (const SensorInput::Thread& sensor : sensors) {
      if (!sensor.of_vehicle) continue;
      // One that could not be created has ended.
      if (!start(sensor.name, rt.sensor_priority, rt.sensor_cpu, [&] { sense(sensor); })) sensorEnded();
    }
    if (options_.started) options_.started(report_.threads);
    for (const SensorInput::Thread& sensor : sensors) {
      if (!sensor.of_vehicle) start(sensor.name, 0, -1, sensor.run);
    }
    waitForEnd();
    for (std::size_t i = 0; i < started_; ++i) {
      threads_[i].join();
      report_.threads[i].faults = threads_[i].pageFaults();
      if (!threads_[i].fault().empty()) {
        report_.faults.push_back(report_.threads[i].name + ": " + threads_[i].fault());
      }
    }
    input_.finish();
    report_.finished = !control_.stopped();
    return std::move(report_);
  }

 private:
  /// The eight of wiring.cpp, and an input's: IMU, two cameras, trigger, and two to spare.
  static constexpr std::size_t kThreads = 14;

  bool start(const char* name, int priority, int cpu, std::function<void()> entry) {
    ThreadSettings settings;
    settings.name = name;
    settings.priority = options_.realtime.enabled ? priority : 0;
    settings.cpu = options_.realtime.enabled ? cpu : -1;
    report_.threads.push_back(threads_.at(started_++).start(settings, std::move(entry)));
    const ThreadReport& report = report_.threads.back();
    if (!report.started) report_.faults.push_back(report.name + ": " + report.message);
    return report.started;
  }

  // Sink.

  void takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host) override {
    wiring_.takeImu(sample, arrival, host);
    propagate_bell_.ring();
    if (wiring_.awaitedSampleCame()) track_bell_.ring();
  }

  void takeScene(const SceneImages& scene) override { wiring_.takeScene(scene); }

  void takeImage(const CameraFrame& image, const HostTimes& host) override {
    wiring_.takeImage(image, host);
    track_bell_.ring();
  }

  void takeImage(const CameraFrame& image, const HostTimes& host, const PixelWriter& pixels) override {
    wiring_.takeImage(image, host, pixels);
    track_bell_.ring();
  }

  // Threads.

  /// The input ends with its last thread, whatever ends it.
  void sensorEnded() {
    if (sensing_.fetch_sub(1) > 1) return;
    wiring_.endInput();
    propagate_bell_.ring();
    track_bell_.ring();
  }

  void sense(const SensorInput::Thread& sensor) {
    struct AtEnd {
      Run& run;
      ~AtEnd() { run.sensorEnded(); }
    } at_end{*this};
    sensor.run();
  }

  void propagate() {
    while (!wiring_.propagateDone()) {
      const std::uint32_t ticket = propagate_bell_.ticket();
      while (wiring_.propagate()) {
      }
      if (!wiring_.propagateDone()) propagate_bell_.wait(ticket, kLongestSleep);
    }
  }

  void track() {
    while (!wiring_.trackDone()) {
      const std::uint32_t ticket = track_bell_.ticket();
      while (wiring_.track()) smooth_bell_.ring();
      if (!wiring_.trackDone()) track_bell_.wait(ticket, kLongestSleep);
    }
    smooth_bell_.ring();
  }

  void smooth() {
    while (!wiring_.smoothDone()) {
      const std::uint32_t ticket = smooth_bell_.ticket();
      while (wiring_.smooth()) {
        propagate_bell_.ring();  // a new fix
        track_bell_.ring();      // room, and a new window
        mesh_bell_.ring();
        loop_bell_.ring();
        map_bell_.ring();
      }
      if (!wiring_.smoothDone()) smooth_bell_.wait(ticket, kLongestSleep);
    }
    mesh_bell_.ring();
    loop_bell_.ring();
    map_bell_.ring();
  }

  void map() {
    while (!wiring_.mapDone()) {
      const std::uint32_t ticket = map_bell_.ticket();
      while (wiring_.map()) {
      }
      if (!wiring_.mapDone()) map_bell_.wait(ticket, kLongestSleep);
    }
  }

  void loop() {
    while (!wiring_.loopDone()) {
      const std::uint32_t ticket = loop_bell_.ticket();
      while (wiring_.loop()) {
      }
      if (!wiring_.loopDone()) loop_bell_.wait(ticket, kLongestSleep);
    }
  }

  void mesh() {
    while (!wiring_.meshDone()) {
      const std::uint32_t ticket = mesh_bell_.ticket();
      while (wiring_.mesh()) {
      }
      if (!wiring_.meshDone()) mesh_bell_.wait(ticket, kLongestSleep);
    }
  }

  template <typename Work>
  void low(Work&& work, std::atomic<bool>& done) {
    const bool recorder = &done == &record_done_;
    try {
      while (!(recorder ? wiring_.recordDone() : wiring_.logDone())) {
        if (!work()) sleepFor(kLowPeriod);
      }
    } catch (...) {
      // A full disk, say: the flight goes on without its files, to its end, and the report names the fault.
      if (!recorder) wiring_.abandonLog();
      done.store(true, std::memory_order_release);
      throw;
    }
    done.store(true, std::memory_order_release);
  }

  void waitForEnd() {
    constexpr Duration kProgressPeriod = Duration::fromMilliseconds(100);
    while (!log_done_.load(std::memory_order_acquire) || !record_done_.load(std::memory_order_acquire)) {
      if (control_.progress) control_.progress(input_.taken());
      sleepFor(kProgressPeriod);
    }
  }

  SensorInput& input_;
  Wiring& wiring_;
  const ThreadedOptions& options_;
  const RunControl& control_;
  ThreadedReport report_;
  std::array<FlightThread, kThreads> threads_;
  std::size_t started_ = 0;

  std::atomic<int> sensing_{0};
  std::atomic<bool> log_done_{false}, record_done_{false};
  Doorbell propagate_bell_, track_bell_, smooth_bell_, mesh_bell_, loop_bell_, map_bell_;
};

}  // namespace

ThreadedReport runThreaded(SensorInput& input, Wiring& wiring, const ThreadedOptions& options,
                           const RunControl& control) {
  return std::make_unique<Run>(input, wiring, options, control)->operator()();
}

}  // namespace swiftlet
