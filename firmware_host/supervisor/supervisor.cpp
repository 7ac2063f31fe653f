#include "firmware_host/supervisor/supervisor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "drivers/device/monotonic_now.hpp"
#include "estimator/messages/names.hpp"

namespace swiftlet {
namespace {

bool sameConditions(const ArmingVerdict& a, const ArmingVerdict& b) {
  return std::ranges::equal(a.missing, b.missing, {}, &MissingCondition::condition,
                            &MissingCondition::condition);
}

bool sameTroubles(const Liveness::Troubles& a, const Liveness::Troubles& b) {
  return std::ranges::equal(a, b, [](const Trouble& x, const Trouble& y) { return x.sameAs(y); });
}

const Trouble* ofRow(const Liveness::Troubles& troubles, std::uint8_t row) {
  const auto* found = std::ranges::find(troubles, row, &Trouble::row);
  return found != troubles.end() ? found : nullptr;
}

/// Appends text to a fixed buffer; what does not fit is cut off.
class Text {
 public:
  explicit Text(std::span<char> into) : into_(into) {}
  template <typename... Arguments>
  void add(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    const std::size_t room = into_.size() - size_;
    const auto end =
        fmt::format_to_n(into_.data() + size_, room, format, std::forward<Arguments>(arguments)...);
    size_ += std::min(room, end.size);
  }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  std::span<char> into_;
  std::size_t size_ = 0;
};

}  // namespace

bool Supervisor::add(std::string_view name, const Heartbeat& heart) {
  Member member;
  std::copy_n(name.data(), std::min(name.size(), member.name.size() - 1), member.name.data());
  member.heart = &heart;
  return liveness_.add(name) && members_.tryPushBack(member);
}

void Supervisor::begin(const FlightGround& ground, Facts facts, SystemdNotify* systemd) {
  ground_ = ground;
  facts_ = std::move(facts);
  systemd_ = systemd;
  liveness_.begin(ground);
  arming_.begin(ground);
}

ThreadReport Supervisor::start(const ThreadSettings& settings) {
  return thread_.start(settings, [this] { run(); });
}

void Supervisor::stop() {
  stopping_.store(true, std::memory_order_release);
  bell_.ring();
  thread_.join();
  tellEnd();
}

void Supervisor::run() {
  Stamp next = monotonicNow();
  while (true) {
    const std::uint32_t ticket = bell_.ticket();
    if (stopping_.load(std::memory_order_acquire)) return;
    const Stamp now = monotonicNow();
    step(now);
    // Missed periods are skipped.
    next = std::max(next + kPeriod, now);
    bell_.wait(ticket, next - monotonicNow());
  }
}

void Supervisor::step(Stamp now) {
  FixedVector<Beat, Liveness::kMostMembers> beats;
  for (const Member& member : members_) static_cast<void>(beats.tryPushBack(member.heart->read()));
  FlightFacts facts;
  if (facts_) facts_(facts);
  // Read after the beats: `ending` is set before any thread returns in order.
  facts.ending = facts.ending || ending_.load(std::memory_order_acquire);

  liveness_.judge({beats.data(), beats.size()}, facts, now);
  const Liveness::Troubles& troubles = liveness_.troubles();
  const EstimateNews& estimate = facts.estimate;
  // A state's health degrades by itself while frames are missing; a frame's health does not.
  Health health = estimate.frames > 0 ? estimate.frame_health : Health::kInitializing;
  if (estimate.has_state && estimate.states > 0) health = worse(health, estimate.state_health);
  const ArmingVerdict arming = arming_.evaluate(facts, health, {troubles.data(), troubles.size()}, now);
  for (const Trouble& trouble : troubles) health = worse(health, trouble.effect);
  if (liveness_.runFailed()) health = Health::kFailed;

  verdict_.evaluated = now;
  verdict_.health = health;
  verdict_.run_failed = liveness_.runFailed();
  verdict_.ending = facts.ending;
  if (!last_arming_ || !sameConditions(arming, *last_arming_)) {
    ++verdict_.arming_changes;
    arming_told_ = false;
  }
  last_arming_ = arming;
  verdict_.arming = arming;
  if (!sameTroubles(troubles, verdict_.troubles)) ++verdict_.trouble_changes;
  verdict_.troubles = troubles;
  run_failed_.store(verdict_.run_failed, std::memory_order_release);
  newest_.write(verdict_);
  for (const Sink& sink : sinks_) sink(verdict_);

  if (findRunClock(facts, now)) {
    tellTroubles(now);
    if (!facts.ending) tellArming();
  }
  tellSystemd(now);
}

/// Events carry the run's clock: the newest message's stamp, extrapolated by the host's clock.
bool Supervisor::findRunClock(const FlightFacts& facts, Stamp now) {
  if (ground_.host_stamps) {
    run_clock_ = now;
    return true;
  }
  std::optional<Stamp> newest;
  const auto see = [&](const SensorNews& news) {
    if (news.messages == 0) return;
    const Stamp carried = news.newest + Duration::fromSeconds((now - news.arrival).seconds() * ground_.speed);
    if (!newest || carried > *newest) newest = carried;
  };
  see(facts.imu);
  for (const SensorNews& camera : facts.camera) see(camera);
  if (newest && (!run_clock_ || *newest > *run_clock_)) run_clock_ = newest;
  return run_clock_.has_value();
}

template <typename Write>
void Supervisor::event(Write&& write) {
  Event* event = events_.beginPush();
  if (event == nullptr) return;  // counted by the ring
  event->stamp = *run_clock_;
  Text text(event->text);
  write(text);
  event->size = text.size();
  events_.commitPush();
}

void Supervisor::tellTroubles(Stamp now) {
  for (const Trouble& trouble : verdict_.troubles) {
    const Trouble* before = ofRow(told_, trouble.row);
    if (before != nullptr && before->sameAs(trouble)) continue;
    event([&](Text& text) {
      text.add("{} is {}: {}", trouble.name(), conditionName(trouble.condition), trouble.text.data());
    });
  }
  for (const Trouble& before : told_) {
    if (ofRow(verdict_.troubles, before.row) != nullptr) continue;
    event([&](Text& text) {
      text.add("{} has recovered after {:.1f} s", before.name(), (now - before.since).seconds());
    });
  }
  told_ = verdict_.troubles;
}

void Supervisor::tellArming() {
  if (arming_told_) return;
  arming_told_ = true;
  const ArmingVerdict& arming = verdict_.arming;
  if (arming.ready() && !first_ready_) first_ready_ = run_clock_;
  event([&](Text& text) {
    text.add("{}", arming.ready() ? "ready to arm" : "not ready to arm:");
    for (const MissingCondition& missing : arming.missing) {
      text.add(" {} ({})", missing.name(), missing.text.data());
    }
  });
}

void Supervisor::tellSystemd(Stamp now) {
  if (systemd_ == nullptr) return;
  if (!ready_sent_) ready_sent_ = systemd_->ready();
  if (verdict_.run_failed || verdict_.ending) {
    tellEnd();
  } else {
    systemd_->watchdog(now);
  }
  std::array<char, 256> line;
  Text text(line);
  text.add("{}, {}", healthName(verdict_.health),
           verdict_.arming.ready() ? "ready to arm" : "not ready to arm");
  for (const Trouble& trouble : verdict_.troubles) {
    text.add("; {} {}", trouble.name(), conditionName(trouble.condition));
  }
  systemd_->status({line.data(), text.size()});
}

/// Tells systemd once; repeated if systemd did not take it.
void Supervisor::tellEnd() {
  if (systemd_ == nullptr || end_told_) return;
  // STOPPING would disarm the watchdog, which must kill a failed run that hangs at its end.
  end_told_ = verdict_.run_failed ? systemd_->limitWatchdog(kLongestFailedEnd) : systemd_->stopping();
}

Verdict Supervisor::verdict() const {
  Verdict verdict;
  // Fails only if overtaken by four writes in a row, which ten writes a second cannot do.
  static_cast<void>(newest_.read(verdict));
  return verdict;
}

bool Supervisor::drainEvents(const std::function<void(Stamp, const std::string&)>& take) {
  bool any = false;
  while (const Event* event = events_.front()) {
    take(event->stamp, std::string(event->text.data(), event->size));
    events_.pop();
    any = true;
  }
  return any;
}

nlohmann::ordered_json Supervisor::json() const {
  nlohmann::ordered_json json = toJson(verdict_);
  json["health"] = healthName(verdict_.health);
  json["arming"]["first_ready_ns"] =
      first_ready_ ? nlohmann::ordered_json(first_ready_->ns) : nlohmann::ordered_json(nullptr);
  json["events_lost"] = events_.refused();
  json["members"] = nlohmann::ordered_json::object();
  for (const Member& member : members_) json["members"][member.name.data()] = member.heart->read().turns;
  return json;
}

}  // namespace swiftlet
