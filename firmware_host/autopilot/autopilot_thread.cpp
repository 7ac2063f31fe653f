#include "firmware_host/autopilot/autopilot_thread.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>

#include "drivers/calibration/input_error.hpp"
#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/autopilot/autopilot_port.hpp"
#include "firmware_host/autopilot/obstacle_message.hpp"
#include "firmware_host/live/device_journal.hpp"
#include "firmware_host/pipeline/follower_thread.hpp"
#include "firmware_host/pipeline/host_sleep.hpp"
#include "firmware_host/pipeline/latency_histogram.hpp"
#include "firmware_host/report/names.hpp"

namespace swiftlet {
namespace {

/// Longest sleep: five rounds within a pose's period, an answer to TIMESYNC within one.
constexpr Duration kRound = Duration::fromMilliseconds(5);
constexpr Duration kObstaclePeriod = Duration::fromMilliseconds(100);
constexpr Duration kReopenPeriod = Duration::fromMilliseconds(200);
/// Three heartbeats of an autopilot.
constexpr Duration kSilence = Duration::fromMilliseconds(3000);
/// Reads of one round: more than a port at 4 Mbaud fills in it.
constexpr int kMostReads = 8;
constexpr double kMillisecondsPerSecond = 1e3;

mavlink::StatusText::Severity severityOf(Health health) {
  if (health == Health::kFailed) return mavlink::StatusText::Severity::kCritical;
  return health == Health::kDegraded ? mavlink::StatusText::Severity::kWarning
                                     : mavlink::StatusText::Severity::kInfo;
}

}  // namespace

AutopilotLinkSettings linkSettings(const AutopilotGroup& settings) {
  const auto about = [](double degrees, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis);
  };
  AutopilotLinkSettings link;
  link.rate = settings.rate_hz;
  link.position_estimate = settings.message == "vision_position_estimate";
  link.mounting.q_vehicle_body = about(settings.yaw_deg, Eigen::Vector3d::UnitZ()) *
                                 about(settings.pitch_deg, Eigen::Vector3d::UnitY()) *
                                 about(settings.roll_deg, Eigen::Vector3d::UnitX());
  link.mounting.p_body_vehicle = {settings.arm_x, settings.arm_y, settings.arm_z};
  link.system = static_cast<std::uint8_t>(settings.system);
  return link;
}

class AutopilotThread::Work {
 public:
  Work(LiveOutlet& outlet, const AutopilotThreadOptions& options)
      : outlet_(outlet),
        options_(options),
        mounting_(linkSettings(options.settings).mounting),
        journal_("autopilot (" + options.settings.device + ")"),
        link_(linkSettings(options.settings)),
        port_(options.settings.device, static_cast<unsigned>(options.settings.baud)) {
    if (const DeviceFault fault = port_.open(); !fault.ok()) {
      throw InputError("settings", 0, "autopilot.device", describe(fault, options.settings.device),
                       "Or leave it empty: nobody is told then");
    }
    ThreadSettings thread;
    thread.name = "autopilot";
    thread.priority = options.priority;
    thread_.start(thread, "settings", "autopilot.device", [this] { run(); });
  }

  void end() { thread_.end(); }

  bool drainEvents(const std::function<void(Stamp, const std::string&)>& take) {
    bool any = false;
    for (DeviceEvent event; journal_.next(event); any = true) take(event.stamp, journal_.text(event));
    return any;
  }

  [[nodiscard]] nlohmann::ordered_json json() const {
    const AutopilotLinkCounters& c = link_.counters();
    const StreamCounters& r = link_.received();
    return {{"poses", c.poses},
            {"poses_of_failure", c.lost_poses},
            {"losses", c.losses},
            {"states_too_old", c.too_old},
            {"obstacles", c.obstacles},
            {"timesync_answers", c.timesync_answers},
            {"texts_dropped", c.texts_dropped},
            {"writes_refused", refused_},
            {"faults", journal_.faults()},
            {"received", {{"frames", r.frames}, {"checksum_failures", r.checksum_failures}}},
            {"state_to_wire_ms",
             {{"p50", kMillisecondsPerSecond * age_.percentile(0.5)},
              {"p99", kMillisecondsPerSecond * age_.percentile(0.99)},
              {"max", kMillisecondsPerSecond * age_.max()}}}};
  }

 private:
  void run() {
    heard_ = monotonicNow();
    while (!thread_.ending()) {
      if (journal_.standing() != DeviceFaultKind::kNone) {
        reopen();
        continue;
      }
      port_.wait(kRound);
      hear();
      takeNews();
      tell();
    }
  }

  void fail(const DeviceFault& fault) {
    port_.close();
    journal_.fault(monotonicNow(), fault);
  }

  void reopen() {
    sleepFor(kReopenPeriod);
    const DeviceFault fault = port_.open();
    if (!fault.ok()) return journal_.fault(monotonicNow(), fault);
    heard_ = monotonicNow();
    journal_.works(heard_);
  }

  void hear() {
    std::array<std::uint8_t, MavlinkParser::kMostFed> bytes;
    for (int i = 0; i < kMostReads; ++i) {
      std::size_t count = 0;
      Stamp read_at;
      if (const DeviceFault fault = port_.read(bytes, count, read_at); !fault.ok()) return fail(fault);
      if (count == 0) break;
      link_.receive(std::span(bytes).first(count), read_at, port_.byteTime());
    }
    const Stamp now = monotonicNow();
    if (link_.received().frames != frames_) {
      frames_ = link_.received().frames;
      heard_ = now;
      journal_.sound(now);
    } else if (now - heard_ > kSilence) {
      journal_.defect(now,
                      deviceFault(DeviceFaultKind::kSilent, 0, "no MAVLink for %.0f s", kSilence.seconds()));
    }
  }

  void takeNews() {
    if (options_.to_host && !to_host_) to_host_ = options_.to_host();
    const bool placed = !options_.to_host || to_host_;
    if (outlet_.state.refresh() != number_ && placed) {
      number_ = outlet_.state.sequence();
      state_ = outlet_.state.value().state();
      omega_body_ = outlet_.state.value().omegaBody();
      state_.stamp = onHost(state_.stamp);
    }
    tellReasons();
    if (outlet_.frame.refresh() > 0 && outlet_.frame.value().health != health_) {
      health_ = outlet_.frame.value().health;
      link_.say(severityOf(health_), fmt::format("swiftlet: {}", healthName(health_)));
    }
    if (options_.settings.obstacles) tellObstacles();
  }

  void tellReasons() {
    const std::uint64_t number = outlet_.arming.refresh();
    if (number == 0) return;
    const Stamp now = monotonicNow();
    const ArmingVerdict& verdict = outlet_.arming.value();
    const bool changed = number != reasons_;
    if (!changed && (verdict.ready() || now < next_reasons_)) return;
    reasons_ = number;
    next_reasons_ = now + options_.repeat;
    if (verdict.ready()) link_.say(mavlink::StatusText::Severity::kInfo, "swiftlet: ready to arm");
    for (const MissingCondition& missing : verdict.missing) {
      link_.say(mavlink::StatusText::Severity::kWarning,
                fmt::format("not ready: {}: {}", missing.name(), missing.text.data()));
    }
  }

  void tellObstacles() {
    const Stamp now = monotonicNow();
    if (number_ == 0 || now < next_obstacles_ || outlet_.mesh.refresh() == 0) return;
    // By the rate on the mean, and never two at once after a pause.
    next_obstacles_ = std::max(next_obstacles_ + kObstaclePeriod, now + Duration{kObstaclePeriod.ns / 2});
    const Stamp stamp = onHost(outlet_.mesh.value().stamp);
    if (now - stamp > kOldestObstacles || now - state_.stamp > AutopilotLink::kOldest) return;
    // A mesh that stands is told again as long as it is fresh, seen from where the vehicle is by now. Both
    // are in the run's clock.
    if (auto message = obstacleDistanceOf(outlet_.mesh.value(), outlet_.state.value().state(), mounting_)) {
      message->time_usec = static_cast<std::uint64_t>(stamp.ns / kNanosecondsPerMicrosecond);
      link_.show(*message);
    }
  }

  void tell() {
    std::array<std::uint8_t, AutopilotLink::kMostBytes> bytes;
    const std::uint64_t poses = link_.counters().poses;
    const std::size_t count = link_.step(monotonicNow(), number_ > 0 ? &state_ : nullptr, omega_body_, bytes);
    if (count == 0) return;
    if (const DeviceFault fault = port_.write(std::span(bytes).first(count)); !fault.ok()) {
      ++refused_;
      if (fault.kind == DeviceFaultKind::kUnplugged) return fail(fault);
      noteRefusal(fault);
    } else if (link_.counters().poses > poses) {
      age_.add((monotonicNow() - state_.stamp).seconds());
    }
  }

  void noteRefusal(const DeviceFault& fault) {
    const Stamp now = monotonicNow();
    if (now < next_refusal_) return;
    next_refusal_ = now + options_.repeat;
    const char* remedy = port_.isUdp() ? "is the network up, and the host on it?"
                                       : "raise autopilot.baud, or lower autopilot.rate_hz";
    journal_.note(
        now, deviceFault(DeviceFaultKind::kLossy, fault.error, "%llu writes were not taken until now: %s",
                         static_cast<unsigned long long>(refused_), remedy));
  }

  [[nodiscard]] Stamp onHost(Stamp stamp) const { return stamp + to_host_.value_or(Duration{}); }

  static constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;

  LiveOutlet& outlet_;
  const AutopilotThreadOptions options_;
  const AutopilotMounting mounting_;
  DeviceJournal journal_;
  AutopilotLink link_;
  AutopilotPort port_;
  NavState state_;  ///< stamp of CLOCK_MONOTONIC
  Eigen::Vector3d omega_body_ = Eigen::Vector3d::Zero();
  std::optional<Duration> to_host_;
  Health health_ = Health::kInitializing;
  std::uint64_t number_ = 0, reasons_ = 0;  ///< taken
  std::uint64_t frames_ = 0;                ///< heard
  Stamp heard_;
  Stamp next_obstacles_;
  Stamp next_reasons_;
  Stamp next_refusal_;
  std::uint64_t refused_ = 0;
  LatencyHistogram age_;
  FollowerThread thread_;
};

AutopilotThread::AutopilotThread(LiveOutlet& outlet, const AutopilotThreadOptions& options)
    : work_(std::make_unique<Work>(outlet, options)) {}
AutopilotThread::~AutopilotThread() = default;

bool AutopilotThread::drainEvents(const std::function<void(Stamp, const std::string&)>& take) {
  return work_->drainEvents(take);
}

nlohmann::ordered_json AutopilotThread::finish() {
  work_->end();
  return work_->json();
}

}  // namespace swiftlet
