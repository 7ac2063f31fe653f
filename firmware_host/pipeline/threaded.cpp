#include "firmware_host/pipeline/threaded.hpp"

#include <ctime>

#include <algorithm>
#include <exception>

#include "firmware_host/realtime/doorbell.hpp"

namespace swiftlet {
namespace {

/// Nobody on the flight path sleeps longer without a look.
constexpr Duration kLongestSleep = Duration::fromMilliseconds(5);
/// How often the low threads look: the recorder's and the log's arrows hold many times as much.
constexpr Duration kLowPeriod = Duration::fromMilliseconds(5);
/// Messages read ahead of their time, and of these images of both cameras: their memory is the source's.
constexpr std::size_t kReadAhead = 256;
constexpr std::uint64_t kImagesAhead = LogSource::kImageSlots - 1;

void sleepUntil(double host_seconds) {
  constexpr double kNanoseconds = 1e9;
  timespec at{};
  at.tv_sec = static_cast<std::time_t>(host_seconds);
  at.tv_nsec = static_cast<long>((host_seconds - static_cast<double>(at.tv_sec)) * kNanoseconds);
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
}

void sleepFor(Duration duration) { sleepUntil(wallSeconds() + duration.seconds()); }

class Run {
 public:
  Run(LogFeed& feed, Wiring& wiring, const ThreadedOptions& options, const RunControl& control)
      : feed_(feed), wiring_(wiring), options_(options), control_(control) {}

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
    start("sensor", rt.sensor_priority, rt.sensor_cpu, [this] { sense(); });
    if (options_.started) options_.started(report_.threads);
    start("source", 0, -1, [this] { read(); });
    waitForEnd();
    for (std::size_t i = 0; i < threads_.size(); ++i) {
      threads_[i].join();
      if (!threads_[i].fault().empty()) {
        report_.faults.push_back(report_.threads[i].name + ": " + threads_[i].fault());
      }
    }
    if (read_error_) std::rethrow_exception(read_error_);
    report_.finished = !control_.stopped();
    return std::move(report_);
  }

 private:
  enum class Kind : std::uint8_t { kSample, kImage };
  struct Ahead {
    Kind kind = Kind::kSample;
    ImuSample sample;
    CameraFrame image;
    SceneImages scene;
    std::uint64_t taken = 0;
  };
  static constexpr std::size_t kThreads = 10;

  void start(const char* name, int priority, int cpu, std::function<void()> entry) {
    ThreadSettings settings;
    settings.name = name;
    settings.priority = options_.realtime.enabled ? priority : 0;
    settings.cpu = options_.realtime.enabled ? cpu : -1;
    report_.threads.push_back(threads_[started_++].start(settings, [this, name, entry] {
      if (options_.watch) options_.watch(name, true);
      entry();
      if (options_.watch) options_.watch(name, false);
    }));
  }

  // Threads.

  void read() {
    try {
      std::uint64_t images = 0;
      for (;;) {
        while (ahead_.size() >= kReadAhead ||
               images - images_out_.load(std::memory_order_acquire) >= kImagesAhead) {
          if (control_.stopped()) break;
          sleepFor(Duration::fromMilliseconds(1));
        }
        const LogFeed::Next next = control_.stopped() ? LogFeed::Next::kEnd : feed_.next();
        if (next == LogFeed::Next::kEnd) break;
        Ahead* message = ahead_.beginPush();
        message->kind = next == LogFeed::Next::kSample ? Kind::kSample : Kind::kImage;
        message->taken = feed_.taken();
        if (message->kind == Kind::kSample) {
          message->sample = feed_.sample();
        } else {
          message->image = feed_.image();
          message->scene = feed_.scene();
          ++images;
        }
        ahead_.commitPush();
      }
    } catch (...) {
      read_error_ = std::current_exception();
    }
    read_done_.store(true, std::memory_order_release);
  }

  void sense() {
    for (;;) {
      const bool done = read_done_.load(std::memory_order_acquire);
      Ahead* message = ahead_.front();
      if (message == nullptr) {
        if (done) break;
        sleepFor(Duration::fromMilliseconds(1));
        continue;
      }
      if (control_.stopped()) break;
      const Stamp arrival = message->kind == Kind::kSample ? message->sample.stamp : message->image.arrival;
      const Stamp stamp = message->kind == Kind::kSample ? message->sample.stamp : message->image.stamp;
      if (!begun_) begin(arrival);
      const double due = hostTime(arrival);
      if (due > wallSeconds()) sleepUntil(due);
      const HostTimes host{hostTime(stamp), wallSeconds()};
      report_.lateness.wall_frames.add(std::max(host.arrival - due, 0.0));
      if (message->kind == Kind::kSample) {
        wiring_.takeImu(message->sample, arrival, host);
        propagate_bell_.ring();
      } else {
        wiring_.takeScene(message->scene);
        wiring_.takeImage(message->image, host);
        track_bell_.ring();
        images_out_.fetch_add(1, std::memory_order_release);
        taken_.store(message->taken, std::memory_order_relaxed);
      }
      ahead_.pop();
    }
    wiring_.endInput();
    propagate_bell_.ring();
    track_bell_.ring();
  }

  void begin(Stamp first) {
    begun_ = true;
    first_ = first;
    // The other threads have a moment to fall asleep.
    constexpr double kLead = 0.05;  // s
    zero_ = wallSeconds() + kLead;
  }
  [[nodiscard]] double hostTime(Stamp stamp) const {
    return zero_ + (stamp - first_).seconds() / options_.speed;
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
      if (control_.progress) control_.progress(taken_.load(std::memory_order_relaxed));
      sleepFor(kProgressPeriod);
    }
  }

  LogFeed& feed_;
  Wiring& wiring_;
  const ThreadedOptions& options_;
  const RunControl& control_;
  ThreadedReport report_;
  std::array<FlightThread, kThreads> threads_;
  std::size_t started_ = 0;

  SpscRing<Ahead, kReadAhead> ahead_;
  std::atomic<std::uint64_t> images_out_{0};  ///< images whose memory the source may use again
  std::atomic<std::uint64_t> taken_{0};
  std::atomic<bool> read_done_{false}, log_done_{false}, record_done_{false};
  std::exception_ptr read_error_;

  bool begun_ = false;
  Stamp first_;
  double zero_ = 0;
  Doorbell propagate_bell_, track_bell_, smooth_bell_, mesh_bell_, loop_bell_, map_bell_;
};

}  // namespace

ThreadedReport runThreaded(LogFeed& feed, Wiring& wiring, const ThreadedOptions& options,
                           const RunControl& control) {
  return std::make_unique<Run>(feed, wiring, options, control)->operator()();
}

}  // namespace swiftlet
