#include "firmware_host/outputs/autopilot/autopilot_thread.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/input/input_error.hpp"
#include "estimator/core/units.hpp"
#include "estimator/messages/names.hpp"
#include "firmware_host/interfaces/device_journal.hpp"
#include "firmware_host/interfaces/link_port.hpp"
#include "firmware_host/outputs/autopilot/obstacle_message.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/realtime/latency_histogram.hpp"

namespace swiftlet {
namespace {

/// Longest sleep. A pose's period has five rounds; TIMESYNC is answered within one.
constexpr Duration kRound = Duration::fromMilliseconds(5);
constexpr Duration kObstaclePeriod = Duration::fromMilliseconds(100);
constexpr Duration kReopenPeriod = Duration::fromMilliseconds(200);
/// Three heartbeat periods of an autopilot.
constexpr Duration kSilence = Duration::fromMilliseconds(3000);
/// Most reads per round: more than a port at 4 Mbaud receives in that time.
constexpr int kMostReads = 8;
constexpr Duration kFloodPause = Duration::fromMilliseconds(1);

mavlink::StatusText::Severity severityOf(Health health) {
  if (health == Health::kFailed) return mavlink::StatusText::Severity::kCritical;
  return health == Health::kDegraded ? mavlink::StatusText::Severity::kWarning
                                     : mavlink::StatusText::Severity::kInfo;
}

/// Shorter than the service's restart delay of 5 s (RestartSec), so that each process begins with another
/// number; the 256 numbers last for 17 minutes.
constexpr Duration kResetStep = Duration::fromMilliseconds(4000);

/// Sets the first reset_counter of this process.
AutopilotLinkSettings restarted(AutopilotLinkSettings link) {
  link.first_reset = static_cast<std::uint8_t>(monotonicNow().ns / kResetStep.ns);
  return link;
}

bool cannotHeal(DeviceFaultKind kind) {
  return kind == DeviceFaultKind::kWrongDevice || kind == DeviceFaultKind::kUnsupported ||
         kind == DeviceFaultKind::kChanged;
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

class AutopilotThread::Work final : public Follower::Work {
  using Severity = mavlink::StatusText::Severity;
  using Troubles = decltype(Verdict::troubles);

 public:
  Work(LiveOutlet& outlet, const AutopilotThreadOptions& options)
      : outlet_(outlet),
        options_(options),
        mounting_(linkSettings(options.settings).mounting),
        journal_("autopilot (" + options.settings.device + ")"),
        link_(restarted(linkSettings(options.settings))),
        port_(options.settings.device, static_cast<unsigned>(options.settings.baud)) {
    if (const DeviceFault fault = openOwn(); !fault.ok()) refuseOrAwait(fault);
    ThreadSettings thread;
    thread.name = "autopilot";
    thread.priority = options.priority;
    thread_.start(thread, "settings", "autopilot.device", [this] { run(); });
  }

  bool drainEvents(const std::function<void(Stamp, const std::string&)>& take) {
    bool any = false;
    for (DeviceEvent event; journal_.next(event); any = true) take(event.stamp, journal_.text(event));
    return any;
  }

  [[nodiscard]] nlohmann::ordered_json json() const override {
    const AutopilotLinkCounters& c = link_.counters();
    const StreamCounters& r = link_.received();
    return {{"poses", c.poses},
            {"poses_of_failure", c.lost_poses},
            {"losses", c.losses},
            {"states_too_old", c.too_old},
            {"poses_held_back", c.held_back},
            {"obstacles", c.obstacles},
            {"timesync_answers", c.timesync_answers},
            {"texts_dropped", c.texts_dropped},
            {"writes_refused", refused_},
            {"faults", journal_.faults()},
            {"received", {{"frames", r.frames}, {"checksum_failures", r.checksum_failures}}},
            {"state_to_wire_ms",
             {{"p50", kToMs * age_.percentile(0.5)},
              {"p99", kToMs * age_.percentile(0.99)},
              {"max", kToMs * age_.max()}}}};
  }

 private:
  DeviceFault openOwn() { return options_.outbox == nullptr ? port_.open() : DeviceFault{}; }

  /// The companion computer may boot before the autopilot: the port is searched for in flight, as after an
  /// unplug, if it can appear by itself. Faults that only other settings can correct end the program.
  void refuseOrAwait(const DeviceFault& fault) {
    const std::string what = describe(fault, options_.settings.device);
    if (cannotHeal(fault.kind)) {
      throw InputError("settings", 0, "autopilot.device", what, "Or leave it empty to disable the output");
    }
    // Resolving a name takes seconds, for which the thread would count as lost. So this ends the program; a
    // restart tries again.
    if (port_.isUdp() && fault.kind == DeviceFaultKind::kMissing) {
      throw std::runtime_error("autopilot.device: " + what + ". Or give the host's number, as 192.168.1.10");
    }
    fail(fault);
  }

  void run() {
    heard_ = monotonicNow();
    if (options_.outbox != nullptr) return runOnAnothersLink(*options_.outbox);
    while (thread_.turn()) {
      if (journal_.standing() != DeviceFaultKind::kNone) {
        reopen();
        continue;
      }
      port_.wait(kRound);
      // More data than a port sends is a flood, which must not occupy the CPU.
      if (!hear()) sleepFor(kFloodPause);
      takeNews();
      link_.knowLine(port_.byteTime());
      tell();
    }
  }

  /// The link's owner handles silence, faults and TIMESYNC.
  void runOnAnothersLink(const LinkOutbox& outbox) {
    while (thread_.turn()) {
      sleepFor(kRound);
      takeNews();
      link_.knowPx4(outbox.px4());
      link_.knowLine(outbox.byteTime());
      if (outbox.attended()) tell();
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

  /// False: more data was waiting than one round reads.
  bool hear() {
    std::array<std::uint8_t, MavlinkParser::kMostFed> bytes;
    int reads = 0;
    for (; reads < kMostReads; ++reads) {
      std::size_t count = 0;
      Stamp read_at;
      if (const DeviceFault fault = port_.read(bytes, count, read_at); !fault.ok()) {
        fail(fault);
        return true;
      }
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
    return reads < kMostReads;
  }

  void takeNews() {
    const Stamp now = monotonicNow();
    if (options_.to_host && !to_host_) to_host_ = options_.to_host();
    const bool placed = !options_.to_host || to_host_;
    if (outlet_.state.refresh() != number_ && placed) {
      number_ = outlet_.state.sequence();
      state_ = outlet_.state.value().state();
      omega_body_ = outlet_.state.value().omegaBody();
      own_health_ = state_.health;
      state_.stamp = onHost(state_.stamp);
      state_came_ = now;
    }
    takeVerdict(now);
    watchStates(now);
    if (options_.settings.obstacles) tellObstacles();
  }

  /// Sends a text from fixed memory; AutopilotLink cuts texts at the same length.
  template <typename... Arguments>
  void say(mavlink::StatusText::Severity severity, fmt::format_string<Arguments...> format,
           Arguments&&... arguments) {
    std::array<char, AutopilotLink::kMostText> text;
    const auto end =
        fmt::format_to_n(text.data(), text.size(), format, std::forward<Arguments>(arguments)...);
    link_.say(severity, {text.data(), std::min(end.size, text.size())});
  }

  void takeVerdict(Stamp now) {
    state_.health = worse(own_health_, Health::kDegraded);  // unless the supervisor says otherwise
    if (outlet_.verdict.refresh() == 0) return;
    const Verdict& verdict = outlet_.verdict.value();
    const bool supervised = !verdict.stale(now) || verdict.ending;
    if (supervised != supervised_) {
      supervised_ = supervised;
      if (supervised) {
        say(Severity::kInfo, "swiftlet: supervisor is running again");
      } else {
        say(Severity::kCritical, "swiftlet: supervisor stopped, health unknown");
      }
    }
    if (!supervised) return;
    // Whether initialization is over is taken from the state: the verdict may be one period older.
    const bool worsens = verdict.health == Health::kDegraded || verdict.health == Health::kFailed;
    state_.health = worsens ? worse(own_health_, verdict.health) : own_health_;
    tellTroubles(verdict);
    tellReasons(verdict, now);
    if (verdict.health == health_) return;
    health_ = verdict.health;
    say(severityOf(health_), "swiftlet: {}", healthName(health_));
  }

  void tellTroubles(const Verdict& verdict) {
    if (verdict.trouble_changes == trouble_changes_) return;
    trouble_changes_ = verdict.trouble_changes;
    const auto in = [](const Troubles& troubles, const Trouble& wanted) {
      return std::ranges::any_of(troubles, [&](const Trouble& one) { return one.row == wanted.row; });
    };
    for (const Trouble& trouble : verdict.troubles) {
      if (std::ranges::any_of(told_, [&](const Trouble& one) { return one.sameAs(trouble); })) continue;
      say(trouble.effect == Health::kFailed ? Severity::kCritical : Severity::kWarning,
          "swiftlet: {} is {}: {}", trouble.name(), conditionName(trouble.condition), trouble.text.data());
    }
    for (const Trouble& before : told_) {
      if (!in(verdict.troubles, before)) say(Severity::kInfo, "swiftlet: {} has recovered", before.name());
    }
    told_ = verdict.troubles;
  }

  void tellReasons(const Verdict& verdict, Stamp now) {
    const ArmingVerdict& arming = verdict.arming;
    const bool changed = verdict.arming_changes != reasons_;
    if (!changed && (arming.ready() || now < next_reasons_)) return;
    reasons_ = verdict.arming_changes;
    next_reasons_ = now + options_.repeat;
    if (arming.ready()) say(Severity::kInfo, "swiftlet: ready to arm");
    for (const MissingCondition& missing : arming.missing) {
      say(Severity::kWarning, "not ready: {}: {}", missing.name(), missing.text.data());
    }
  }

  /// Reports missing states as text, in addition to the poses' quality -1 and silence. Works without a
  /// supervisor.
  void watchStates(Stamp now) {
    if (number_ == 0) return;
    const bool stopped = now - state_came_ > AutopilotLink::kSilence && !outlet_.verdict.value().ending;
    if (stopped == states_stopped_) return;
    states_stopped_ = stopped;
    if (stopped) {
      say(Severity::kCritical, "swiftlet: no new state for {:.1f} s", AutopilotLink::kSilence.seconds());
    } else {
      say(Severity::kInfo, "swiftlet: states are arriving again");
    }
  }

  void tellObstacles() {
    const Stamp now = monotonicNow();
    if (number_ == 0 || now < next_obstacles_ || outlet_.mesh.refresh() == 0) return;
    // Keeps the rate on average, without sending two in a row after a pause.
    next_obstacles_ = std::max(next_obstacles_ + kObstaclePeriod, now + Duration{kObstaclePeriod.ns / 2});
    if (now - state_.stamp > AutopilotLink::kOldest) return;
    // The same mesh is sent again while it is fresh, seen from the vehicle's current position. Mesh and state
    // are on the run's clock.
    NavState seen_from = outlet_.state.value().state();
    seen_from.health = state_.health;
    if (auto message = obstacleDistanceOf(outlet_.mesh.value(), seen_from, mounting_)) {
      const Stamp stamp = onHost(outlet_.mesh.value().stamp);
      message->time_usec = static_cast<std::uint64_t>(stamp.ns / kNanosecondsPerMicrosecond);
      link_.show(*message);
    }
  }

  void tell() {
    std::array<std::uint8_t, AutopilotLink::kMostBytes> bytes;
    const std::uint64_t poses = link_.counters().poses;
    const std::size_t count = link_.step(monotonicNow(), number_ > 0 ? &state_ : nullptr, omega_body_, bytes);
    if (link_.counters().held_back > held_back_) noteLoss({});
    held_back_ = link_.counters().held_back;
    if (count == 0) return;
    if (const DeviceFault fault = send(std::span(bytes).first(count)); !fault.ok()) {
      ++refused_;
      if (fault.kind == DeviceFaultKind::kUnplugged) return fail(fault);
      noteLoss(fault);
    } else if (link_.counters().poses > poses) {
      age_.add((monotonicNow() - state_.stamp).seconds());
    }
  }

  DeviceFault send(std::span<const std::uint8_t> bytes) {
    static_assert(AutopilotLink::kMostBytes <= LinkOutbox::kMostBytes);
    static_assert(AutopilotLink::kMostBytes <= LinkPort::kMostWritten);
    if (options_.outbox == nullptr) return port_.write(bytes);
    if (options_.outbox->push(bytes)) return {};
    return deviceFault(DeviceFaultKind::kFailed, 0, "the IMU's link accepts no more data");
  }

  void noteLoss(const DeviceFault& fault) {
    const Stamp now = monotonicNow();
    if (now < next_refusal_) return;
    next_refusal_ = now + options_.repeat;
    const char* remedy = port_.isUdp() ? "check that the network is up and the host is reachable"
                                       : "raise autopilot.baud, or lower autopilot.rate_hz";
    journal_.note(now, deviceFault(DeviceFaultKind::kLossy, fault.error,
                                   "%llu poses held back and %llu writes rejected so far: %s",
                                   static_cast<unsigned long long>(link_.counters().held_back),
                                   static_cast<unsigned long long>(refused_), remedy));
  }

  [[nodiscard]] Stamp onHost(Stamp stamp) const { return stamp + to_host_.value_or(Duration{}); }

  static constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;

  LiveOutlet& outlet_;
  const AutopilotThreadOptions options_;
  const AutopilotMounting mounting_;
  DeviceJournal journal_;
  AutopilotLink link_;
  LinkPort port_;
  NavState state_;  ///< its stamp is of CLOCK_MONOTONIC
  Eigen::Vector3d omega_body_ = Eigen::Vector3d::Zero();
  std::optional<Duration> to_host_;
  Health own_health_ = Health::kInitializing;  ///< health of the state itself
  Health health_ = Health::kInitializing;      ///< health of the verdict sent last
  bool supervised_ = true, states_stopped_ = false;
  Troubles told_;
  std::uint64_t number_ = 0;                         ///< number of the newest state taken
  std::uint32_t reasons_ = 0, trouble_changes_ = 0;  ///< numbers of the changes sent last
  std::uint64_t frames_ = 0;                         ///< counter of frames received
  Stamp state_came_;
  Stamp heard_;
  Stamp next_obstacles_;
  Stamp next_reasons_;
  Stamp next_refusal_;
  std::uint64_t refused_ = 0, held_back_ = 0;
  LatencyHistogram age_;
};

AutopilotThread::AutopilotThread(LiveOutlet& outlet, const AutopilotThreadOptions& options)
    : Follower(std::make_unique<Work>(outlet, options)) {}

bool AutopilotThread::drainEvents(const std::function<void(Stamp, const std::string&)>& take) {
  return static_cast<Work&>(*work_).drainEvents(take);
}

}  // namespace swiftlet
