#include "estimator/odometry/stamp_guard.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

/// ns from `from` to a later stamp; for any two stamps.
std::uint64_t stepTo(Stamp from, Stamp to) {
  return static_cast<std::uint64_t>(to.ns) - static_cast<std::uint64_t>(from.ns);
}

bool isNear(Stamp a, Stamp b) { return !isFarAhead(a, b) && !isFarAhead(b, a); }

}  // namespace

bool isFarAhead(Stamp from, Stamp to) {
  return to > from && stepTo(from, to) > static_cast<std::uint64_t>(kFarAhead.ns);
}

bool BackwardRun::note(Stamp stamp, int needed) {
  const bool goes_on = length_ > 0 && stamp > last_ && !isFarAhead(last_, stamp);
  length_ = goes_on ? length_ + 1 : 1;
  last_ = stamp;
  return length_ >= needed;
}

StampGuard::StampGuard(double rate_hz)
    : needed_(std::max(kLeastAgreeing,
                       std::isfinite(rate_hz) ? static_cast<int>(std::lround(kAgreeSeconds * rate_hz)) : 0)) {
}

StampVerdict StampGuard::check(Stamp stamp) {
  StampVerdict verdict = StampVerdict::kPass;
  if (time_.any && stamp <= time_.newest) {
    holds_ = false;
    if (!back_.note(stamp, needed_)) return StampVerdict::kBehind;
    ++time_.timeline;
    verdict = StampVerdict::kRestarted;
  } else if (time_.any && isFarAhead(time_.newest, stamp)) {
    // The next sample confirms it if it is not far from it, or, for a slow stream in which every step is far,
    // if this step is not longer than the one before.
    const bool confirmed = holds_ && stamp > held_ &&
                           (!isFarAhead(held_, stamp) || stepTo(held_, stamp) <= stepTo(time_.newest, held_));
    if (!confirmed) {
      holds_ = true;
      held_ = stamp;
      return StampVerdict::kHeld;
    }
    ++time_.jumps;
    verdict = StampVerdict::kJumped;
  }
  time_.any = true;
  time_.newest = stamp;
  holds_ = false;
  back_.clear();
  return verdict;
}

StampVerdict ImageGuard::check(Stamp stamp, const ImuTime& imu) {
  const bool near = imu.any && isNear(stamp, imu.newest);
  if (imu.any != seen_.any || imu.timeline != seen_.timeline || imu.jumps != seen_.jumps) fits_ = false;
  seen_ = imu;
  if (imu.any && !fits_) {
    if (!near) return StampVerdict::kHeld;
    fits_ = true;
    any_ = false;  // positions before the IMU's jump are meaningless
  }
  StampVerdict verdict = StampVerdict::kPass;
  if (any_ && stamp <= newest_) {
    // Far from both: not a late image, but one of another time line.
    if (imu.any && !near && isFarAhead(stamp, newest_)) return StampVerdict::kHeld;
    if (!back_.note(stamp, kAgreeing) || (imu.any && !near)) return StampVerdict::kBehind;
    verdict = StampVerdict::kRestarted;
  } else if (any_ && isFarAhead(newest_, stamp)) {
    if (imu.any && !near) return StampVerdict::kHeld;
    verdict = StampVerdict::kJumped;
  }
  any_ = true;
  newest_ = stamp;
  back_.clear();
  return verdict;
}

}  // namespace swiftlet
