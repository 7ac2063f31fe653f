#include "drivers/timesync/clock_map.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/timesync/stamp_limit.hpp"

namespace swiftlet {
namespace {

constexpr double kPpm = 1e-6;
// A clock step ahead shows as a delay below the envelope. Up to this size it is accepted at once: a wrong
// decision only restarts the envelope from a valid point. A larger one must persist, so that one garbled
// stamp does not shift the clock.
constexpr double kAtOnce = 5e6;         // ns
constexpr double kStepTolerance = 2e5;  // ns: smaller steps are within the required accuracy
constexpr double kTooOld = 1e9;         // ns: too late for the estimator; steps back look like this too
// Conditions for a new clock: this many stamps over this span that advance as fast as their arrivals. A queue
// that is emptied after a stall does not meet them: its arrivals hardly advance.
constexpr int kConfirm = 5;
constexpr std::int64_t kConfirmSpan = 50'000'000;
constexpr std::int64_t kConfirmSlack = 20'000'000;
// A step back is detected when no delay comes near the smallest any more (LowerEnvelope::raised). The
// tolerance is the deviation from a line of a crystal that warms up at 0.8 ppm/s. Links can be busy for a
// while, but for less than these 2 s.
constexpr double kRaisedTolerance = 1e5;  // ns
constexpr std::size_t kRaisedBins = 8;
constexpr double kSurprise = 16;
// Locked: at least this many bins (2 s of data) over this span, and a small enough uncertainty of the fit.
constexpr std::size_t kLockBins = 8;
constexpr std::int64_t kLockSpan = 4'000'000'000;
constexpr double kLockUncertainty = 2e5;  // ns

}  // namespace

double ClockMap::tolerance(Stamp device) const { return kStepTolerance + 4 * envelope_.uncertainty(device); }

Status ClockMap::add(Stamp device, Stamp arrival, Stamp& host) {
  if (!withinLimit(device) || !withinLimit(arrival)) {
    ++refused_;
    return {StatusCode::kInvalidInput, "stamp out of range"};
  }
  const std::int64_t delayed = arrival.ns - device.ns;
  if (!envelope_.empty()) {
    const double above = envelope_.heightOf(device, delayed);
    if (device <= newest_ || above > kTooOld || above < -kAtOnce - tolerance(device) ||
        nearerToCandidate(delayed, above)) {
      return suspect(device, arrival, delayed, host);
    }
    if (envelope_.bins() >= kLockBins && above < -tolerance(device)) {
      envelope_.restart();
      ++resets_;
    }
    step_ = device - newest_;
  }
  candidate_.count = 0;
  envelope_.add(device, delayed);
  watchForStepBack();
  return handOut(device, arrival, host);
}

bool ClockMap::nearerToCandidate(std::int64_t delayed, double above) const {
  return candidate_.count > 0 && 2 * std::abs(static_cast<double>(delayed - candidate_.lowest)) < above;
}

Status ClockMap::suspect(Stamp device, Stamp arrival, std::int64_t delayed, Stamp& host) {
  Candidate& c = candidate_;
  if (c.count == 0 || device <= c.newest_device) {
    c = {0, device, arrival, device, device, delayed};
  }
  if (delayed < c.lowest) {
    c.lowest = delayed;
    c.lowest_device = device;
  }
  const Duration step = device - c.newest_device;
  c.newest_device = device;
  c.count = std::min(c.count + 1, kConfirm);
  const std::int64_t on_device = (device - c.first_device).ns;
  const std::int64_t on_host = (arrival - c.first_arrival).ns;
  const double apart = std::abs(static_cast<double>(on_host) - static_cast<double>(on_device));
  const bool agree = apart <= static_cast<double>(kConfirmSlack) + static_cast<double>(on_device) / 2;
  if (c.count < kConfirm || on_device < kConfirmSpan || !agree) {
    ++refused_;
    return {StatusCode::kInvalidInput, "device stamp far from the clock: rejected until it persists"};
  }
  envelope_.restart();
  envelope_.add(c.lowest_device, c.lowest);
  envelope_.add(device, delayed);
  c.count = 0;
  step_ = step;
  ++resets_;
  return handOut(device, arrival, host);
}

void ClockMap::watchForStepBack() {
  if (envelope_.closed() == seen_bins_) return;
  seen_bins_ = envelope_.closed();
  Stamp since;
  if (!envelope_.raised(kRaisedBins, kRaisedTolerance, kSurprise, since)) return;
  envelope_.dropBefore(since);
  ++resets_;
}

Status ClockMap::handOut(Stamp device, Stamp arrival, Stamp& host) {
  newest_ = device;
  const Stamp latest = arrival - constant_delay_;
  const Stamp mapped = {device.ns + envelope_.at(device) - constant_delay_.ns};
  delays_.add(arrival, latest - mapped);
  if (!rising_.next(std::min(mapped, latest), step_, host)) {
    ++refused_;
    return {StatusCode::kInvalidInput, "stamp would go backwards"};
  }
  ++samples_;
  return okStatus();
}

std::optional<Stamp> ClockMap::toHost(Stamp device) const {
  if (envelope_.empty() || !withinLimit(device)) return std::nullopt;
  return Stamp{device.ns + envelope_.at(device) - constant_delay_.ns};
}

LockState ClockMap::lock() const {
  if (envelope_.empty()) return LockState::kUnlocked;
  const bool enough = envelope_.bins() >= kLockBins && envelope_.span().ns >= kLockSpan;
  return enough && envelope_.uncertainty(newest_) <= kLockUncertainty ? LockState::kLocked
                                                                      : LockState::kLocking;
}

TimesyncStatus ClockMap::status() const {
  TimesyncStatus s;
  s.lock = lock();
  if (!envelope_.empty()) {
    s.offset = {envelope_.at(newest_) - constant_delay_.ns};
    s.uncertainty = {static_cast<std::int64_t>(std::min(envelope_.uncertainty(newest_), kTooOld))};
  }
  s.skew_ppm = envelope_.slope() / kPpm;
  s.residual_p50 = delays_.quantile(0.5);
  s.residual_p99 = delays_.quantile(0.99);
  s.samples = samples_;
  s.resets = resets_;
  s.refused = refused_;
  return s;
}

}  // namespace swiftlet
