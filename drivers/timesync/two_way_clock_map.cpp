#include "drivers/timesync/two_way_clock_map.hpp"

#include <algorithm>

#include "drivers/timesync/stamp_limit.hpp"

namespace swiftlet {
namespace {

constexpr double kPpm = 1e-6;
constexpr double kAtOnce = 5e6;         // ns; as in ClockMap
constexpr double kStepTolerance = 2e5;  // ns
constexpr int kConfirm = 3;
// Exchanges with the same new clock agree to within its drift between them.
constexpr std::int64_t kConfirmSlack = 1'000'000;
constexpr double kRaisedTolerance = 1e5;  // ns; these three as in ClockMap
constexpr std::size_t kRaisedBins = 8;
constexpr double kSurprise = 16;
constexpr std::size_t kLockBins = 8;
constexpr std::int64_t kLockSpan = 4'000'000'000;
constexpr double kLockUncertainty = 2e5;  // ns
constexpr double kMostUncertainty = 1e9;  // ns, for the report
constexpr std::uint64_t kFirstExchanges = 5;
constexpr std::int64_t kLongestTrip = 10'000'000'000;  // longer: the answer to a request long forgotten

}  // namespace

double TwoWayClockMap::uncertainty(Stamp remote) const {
  return (back_.uncertainty(remote) + forth_.uncertainty(remote)) / 2;
}

std::int64_t TwoWayClockMap::difference(Stamp remote) const {
  return back_.at(remote) / 2 - forth_.at(remote) / 2;
}

Status TwoWayClockMap::add(const ClockExchange& exchange) {
  const bool in_range =
      withinLimit(exchange.send) && withinLimit(exchange.remote) && withinLimit(exchange.receive);
  if (!in_range || exchange.receive < exchange.send || (exchange.receive - exchange.send).ns > kLongestTrip) {
    ++refused_;
    return {StatusCode::kInvalidInput, "not an exchange: received before sent, or 10 s after"};
  }
  if (!back_.empty()) {
    const double back = back_.heightOf(exchange.remote, (exchange.receive - exchange.remote).ns);
    const double forth = forth_.heightOf(exchange.remote, (exchange.remote - exchange.send).ns);
    const double tolerance = kStepTolerance + 4 * uncertainty(exchange.remote);
    if (exchange.remote <= newest_ || std::min(back, forth) < -kAtOnce - tolerance) return suspect(exchange);
    lower(back_, back, tolerance);
    lower(forth_, forth, tolerance);
  }
  learn(exchange);
  return okStatus();
}

Status TwoWayClockMap::suspect(const ClockExchange& exchange) {
  const std::int64_t low = (exchange.send - exchange.remote).ns - kConfirmSlack;
  const std::int64_t high = (exchange.receive - exchange.remote).ns + kConfirmSlack;
  const bool agrees = suspects_ > 0 && exchange.remote > suspect_newest_ &&
                      std::max(low, suspect_low_) <= std::min(high, suspect_high_);
  suspect_low_ = agrees ? std::max(low, suspect_low_) : low;
  suspect_high_ = agrees ? std::min(high, suspect_high_) : high;
  suspects_ = agrees ? suspects_ + 1 : 1;
  suspect_newest_ = exchange.remote;
  if (suspects_ < kConfirm) {
    ++refused_;
    return {StatusCode::kInvalidInput, "remote stamp far from the clock: rejected until it persists"};
  }
  back_.restart();
  forth_.restart();
  ++resets_;
  learn(exchange);
  return okStatus();
}

void TwoWayClockMap::lower(LowerEnvelope& side, double above, double tolerance) {
  if (above >= -tolerance || side.bins() < kLockBins) return;
  side.restart();
  ++resets_;
}

void TwoWayClockMap::watchForRise(LowerEnvelope& side) {
  Stamp since;
  if (!side.raised(kRaisedBins, kRaisedTolerance, kSurprise, since)) return;
  side.dropBefore(since);
  ++resets_;
}

void TwoWayClockMap::learn(const ClockExchange& exchange) {
  suspects_ = 0;
  newest_ = exchange.remote;
  const std::uint64_t closed = back_.closed();
  back_.add(exchange.remote, (exchange.receive - exchange.remote).ns);
  forth_.add(exchange.remote, (exchange.remote - exchange.send).ns);
  if (back_.closed() != closed) {
    watchForRise(back_);
    watchForRise(forth_);
  }
  const Duration trip = exchange.receive - exchange.send;
  const Duration smallest = {2 * (back_.at(exchange.remote) / 2 + forth_.at(exchange.remote) / 2)};
  round_trips_.add(exchange.receive, trip - smallest);
  ++samples_;
  was_locked_ = was_locked_ || lock() == LockState::kLocked;
}

std::optional<Stamp> TwoWayClockMap::toHost(Stamp remote) const {
  if (back_.empty() || !withinLimit(remote)) return std::nullopt;
  return Stamp{remote.ns + difference(remote)};
}

LockState TwoWayClockMap::lock() const {
  if (back_.empty()) return LockState::kUnlocked;
  const bool enough = back_.bins() >= kLockBins && back_.span().ns >= kLockSpan;
  return enough && uncertainty(newest_) <= kLockUncertainty ? LockState::kLocked : LockState::kLocking;
}

bool TwoWayClockMap::usable() const {
  return lock() == LockState::kLocked || (!was_locked_ && resets_ == 0 && samples_ >= kFirstExchanges);
}

TimesyncStatus TwoWayClockMap::status() const {
  TimesyncStatus s;
  s.lock = lock();
  if (!back_.empty()) {
    s.offset = {difference(newest_)};
    s.uncertainty = {static_cast<std::int64_t>(std::min(uncertainty(newest_), kMostUncertainty))};
    s.error_bound = {back_.at(newest_) / 2 + forth_.at(newest_) / 2};
  }
  s.skew_ppm = (back_.slope() - forth_.slope()) / 2 / kPpm;
  s.residual_p50 = round_trips_.quantile(0.5);
  s.residual_p99 = round_trips_.quantile(0.99);
  s.samples = samples_;
  s.resets = resets_;
  s.refused = refused_;
  return s;
}

}  // namespace swiftlet
