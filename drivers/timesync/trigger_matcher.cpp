#include "drivers/timesync/trigger_matcher.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/timesync/stamp_limit.hpp"

namespace swiftlet {
namespace {

// Frames needed to lock. For stamps that scatter evenly by +-0.4 periods the standard deviation of their mean
// is 0.04 periods, or 0.08 with fewer frames when the lag is already known.
constexpr int kFirstLock = 32;
constexpr int kNextLock = 8;
constexpr double kWidest = 0.95;    // periods from the least to the largest D: a slip makes the range wider
constexpr double kAmbiguous = 0.3;  // periods from the expected lag
constexpr double kMoved = 0.25;     // periods between the mean of few frames and the known lag
// Bounds of |D - lag|. A slip by one pulse moves D by one period, or by 0.9 after a pause of the trigger
// (EdgeTrain accepts 0.1 off the grid). With a scatter of 0.4 periods |D - lag| is then at least 0.5. If
// stamps scatter less, the bound is narrower, but not below kNarrowest, so that the lag can follow a changing
// exposure.
constexpr double kVerified = 0.5;    // periods
constexpr double kNarrowest = 0.35;  // periods
constexpr double kSpreadMargin = 1.2;
constexpr int kDisputes = 3;
constexpr int kEdgeless = 16;  // frames: as many periods as EdgeTrain bridges
constexpr double kLagGain = 1.0 / 64;
constexpr std::int64_t kMostDropped = 1000;  // frames; a larger jump is another stream
constexpr double kMostPeriods = 3;           // largest correction of the count
// [ns] How much later than the arrival of its frame an edge may seem: edges stamped by an IMU's clock still
// contain the constant delay of its link.
constexpr double kClockError = 2e6;

double apart(Stamp from, Stamp to) { return static_cast<double>(to.ns - from.ns); }
double ns(Duration duration) { return static_cast<double>(duration.ns); }

double clockError(double period) { return std::min(kClockError, kAmbiguous * period); }

/// Difference of two sequence numbers across the wrap; negative: the stream restarted.
std::int64_t advance(std::uint32_t from, std::uint32_t to) { return static_cast<std::int32_t>(to - from); }

}  // namespace

void TriggerMatcher::giveUp() {
  if (lock_ == LockState::kLocked) ++resets_;
  lock_ = LockState::kUnlocked;
  count_ = 0;
  disputes_ = 0;
  edgeless_ = 0;
}

void TriggerMatcher::begin(const FrameMark& frame) {
  count_ = 0;
  const double guess = lag_known_ ? lag_ : ns(expected_);
  const auto pulse = train_->nearest({frame.stamp.ns - std::llround(guess)});
  if (!pulse) return;
  pulse_ = *pulse;
  lock_ = LockState::kLocking;
  sum_ = 0;
  least_ = 1e18;
  most_ = -1e18;
  soonest_ = 1e18;
}

double TriggerMatcher::verified(double period) const {
  return std::clamp(kSpreadMargin * spread_, kNarrowest * period, kVerified * period);
}

Status TriggerMatcher::match(const FrameMark& frame, TriggerMatch& out) {
  if (!withinLimit(frame.stamp) || !withinLimit(frame.arrival)) {
    ++refused_;
    return {StatusCode::kInvalidInput, "stamp out of range"};
  }
  if (epoch_ != train_->epoch()) giveUp();
  epoch_ = train_->epoch();
  if (lock_ != LockState::kLocked) return collect(frame, out);

  const std::int64_t steps = advance(sequence_, frame.sequence);
  if (steps == 0) {
    ++unmatched_;
    return {StatusCode::kInvalidInput, "frame number repeated"};
  }
  if (steps < 0 || steps > kMostDropped) {
    giveUp();
    return collect(frame, out);
  }
  sequence_ = frame.sequence;
  pulse_ += steps;
  const auto edge = train_->at(pulse_);
  const double period = ns(train_->period());
  if (!edge) {
    ++unmatched_;
    if (++edgeless_ >= kEdgeless) giveUp();
    return {StatusCode::kNotReady, "no edge near this frame"};
  }
  edgeless_ = 0;
  const double off = apart(edge->stamp, frame.stamp) - lag_;
  const bool caused = apart(edge->stamp, frame.arrival) > -clockError(period);
  if (!caused || std::abs(off) > verified(period)) {
    ++unmatched_;
    if (++disputes_ >= kDisputes) giveUp();
    return {StatusCode::kInvalidInput, "frame number and stamp belong to different edges"};
  }
  disputes_ = 0;
  lag_ += kLagGain * off;
  spread_ = std::max(spread_, std::abs(off));
  residuals_.add(frame.arrival, {std::llround(std::abs(off))});
  out = {pulse_, epoch_, edge->stamp, edge->measured};
  ++matched_;
  return okStatus();
}

Status TriggerMatcher::collect(const FrameMark& frame, TriggerMatch& out) {
  constexpr Status kNotYet = {StatusCode::kNotReady, "trigger not locked: the driver's stamp is used"};
  const std::int64_t steps = count_ == 0 ? 0 : advance(sequence_, frame.sequence);
  if (count_ == 0 || steps <= 0 || steps > kMostDropped) {
    begin(frame);
  } else {
    pulse_ += steps;
  }
  sequence_ = frame.sequence;
  ++refused_;
  if (lock_ != LockState::kLocking) return kNotYet;
  const auto edge = train_->at(pulse_);
  if (!edge) {
    giveUp();
    return kNotYet;
  }
  const double d = apart(edge->stamp, frame.stamp);
  ++count_;
  sum_ += d;
  least_ = std::min(least_, d);
  most_ = std::max(most_, d);
  soonest_ = std::min(soonest_, apart(edge->stamp, frame.arrival));
  if (most_ - least_ > kWidest * ns(train_->period())) {
    giveUp();
    return kNotYet;
  }
  if (count_ < (lag_known_ ? kNextLock : kFirstLock)) return kNotYet;
  if (!decide()) {
    giveUp();
    lag_known_ = false;
    return {StatusCode::kDegenerate, "frames lie between two edges: correct the expected lag"};
  }
  // From here the frame is verified and matched like all later ones.
  lock_ = LockState::kLocked;
  lag_known_ = true;
  count_ = 0;
  --refused_;
  sequence_ = frame.sequence - 1;
  --pulse_;
  return match(frame, out);
}

bool TriggerMatcher::decide() {
  const double period = ns(train_->period());
  const double mean = sum_ / count_;
  const double expected = lag_known_ ? lag_ : ns(expected_);
  const double periods = std::round((mean - expected) / period);  // pulses to add
  double lag = mean - periods * period;
  const double limit = lag_known_ ? kMoved : kAmbiguous;
  if (!(std::abs(lag - expected) <= limit * period) || std::abs(periods) > kMostPeriods) return false;
  if (soonest_ - periods * period < -clockError(period)) return false;
  // The known lag is more accurate than the mean of a few frames.
  if (lag_known_) lag = lag_;
  const double centre = lag + periods * period;
  const double spread = std::max(most_ - centre, centre - least_);
  if (spread > kVerified * period) return false;
  pulse_ += static_cast<std::int64_t>(periods);
  lag_ = lag;
  spread_ = std::max(spread_, spread);
  return true;
}

std::optional<Duration> TriggerMatcher::lag() const {
  return lag_known_ ? std::optional(Duration{std::llround(lag_)}) : std::nullopt;
}

TimesyncStatus TriggerMatcher::status() const {
  TimesyncStatus s;
  s.lock = lock_;
  s.offset = {std::llround(lag_)};
  s.residual_p50 = residuals_.quantile(0.5);
  s.residual_p99 = residuals_.quantile(0.99);
  s.samples = matched_;
  s.resets = resets_;
  s.refused = refused_;
  s.missed_edges = train_->missed();
  s.glitch_edges = train_->glitches();
  s.unmatched_frames = unmatched_;
  return s;
}

}  // namespace swiftlet
