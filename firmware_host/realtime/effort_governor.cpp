#include "firmware_host/realtime/effort_governor.hpp"

#include <algorithm>

namespace swiftlet {
namespace {

constexpr double kHigh = 0.9;   ///< share of the budget above which a miss is near
constexpr double kLow = 0.7;    ///< share of the budget below which there is room
constexpr double kAmple = 2;    ///< one level up costs at most this factor
constexpr double kFarOver = 2;  ///< times the budget above which one level down is not enough
constexpr int kCrowd = 2;       ///< frames waiting; a single one may have arrived during the step
constexpr int kLateOnEnd = 3;   ///< consecutive steps; a single delay is made up within two
constexpr int kGoodCredit = 4;
constexpr int kFairCredit = 1;
constexpr int kMostBackoff = 8;

constexpr int kLeastFeatures = 40;
constexpr int kLeastKeyframes = 5;
constexpr int kSmootherFeatureLevels = 3;

/// Three quarters of `value`, but not below `least` unless `value` already is.
int threeQuarters(int value, int least) { return std::max(value * 3 / 4, std::min(value, least)); }

/// Appends `next` if it differs from the last entry and there is room.
bool appendIfNew(EffortLadder& ladder, const Effort& next) {
  return next != ladder.back() && ladder.tryPushBack(next);
}

EffortLadder ladderFrom(Effort full) {
  full.iterations = std::max(full.iterations, 1);
  full.features = std::max(full.features, 1);
  full.keyframes = std::max(full.keyframes, 1);
  EffortLadder ladder;
  ladder.resize(1);
  ladder[0] = full;
  return ladder;
}

/// NaN becomes 0 too.
double atLeastZero(double seconds) { return seconds > 0 ? seconds : 0; }

}  // namespace

EffortLadder trackerLadder(const Effort& full) {
  EffortLadder ladder = ladderFrom(full);
  for (bool grew = true; grew;) {
    Effort next = ladder.back();
    next.features = threeQuarters(next.features, kLeastFeatures);
    grew = appendIfNew(ladder, next);
  }
  return ladder;
}

EffortLadder smootherLadder(const Effort& full) {
  EffortLadder ladder = ladderFrom(full);
  for (bool grew = true; grew;) {
    Effort next = ladder.back();
    next.iterations = std::max(next.iterations / 2, 1);
    grew = appendIfNew(ladder, next);
  }
  for (int i = 0; i < kSmootherFeatureLevels; ++i) {
    Effort next = ladder.back();
    next.features = threeQuarters(next.features, kLeastFeatures);
    appendIfNew(ladder, next);
  }
  for (bool grew = true; grew;) {
    Effort next = ladder.back();
    next.keyframes = threeQuarters(next.keyframes, kLeastKeyframes);
    grew = appendIfNew(ladder, next);
  }
  return ladder;
}

EffortGovernor::EffortGovernor(const EffortLadder& ladder, const GovernorSettings& settings)
    : ladder_(ladder.empty() ? ladderFrom(Effort{}) : ladder), settings_(settings) {
  settings_.good_steps = std::max(settings_.good_steps, 1);
}

double EffortGovernor::predicted() const {
  const std::size_t known = std::min(step_count_, kWindow);
  double longest = 0;
  double second = 0;
  for (std::size_t i = 0; i < known; ++i) {
    second = std::max(second, std::min(steps_[i], longest));
    longest = std::max(longest, steps_[i]);
  }
  return after_drop_ && known < kWindow ? longest : second;
}

void EffortGovernor::remember(double wall) { steps_[step_count_++ % kWindow] = wall; }

std::optional<EffortReason> EffortGovernor::missAhead(const StepTiming& timing) {
  const double expected = predicted();
  const bool late =
      atLeastZero(timing.age) + std::max(expected, atLeastZero(timing.wall)) > settings_.age_budget;
  late_steps_ = late ? late_steps_ + 1 : 0;
  const bool crowded = timing.waiting >= kCrowd && timing.waiting >= waiting_before_;
  waiting_before_ = timing.waiting;
  if (crowded) return EffortReason::kBacklog;
  if (expected > kHigh * settings_.step_budget) return EffortReason::kPredictedMiss;
  if (late_steps_ >= kLateOnEnd) return EffortReason::kLate;
  return std::nullopt;
}

void EffortGovernor::credit(double wall, double predicted) {
  if (late_steps_ > 0 || waiting_before_ >= kCrowd) {
    credit_ = 0;
  } else if (wall <= kHigh * settings_.step_budget) {
    // A single slow step is not credited, but does not reset the credit either.
    const bool good = std::max(wall, predicted) <= kLow * settings_.step_budget;
    credit_ += good ? kGoodCredit : kFairCredit;
  }
}

EffortChange EffortGovernor::moveTo(int level, EffortReason why, double predicted) {
  const EffortChange change{level_, level, ladder_[static_cast<std::size_t>(level)], why, predicted};
  after_drop_ = level > level_;
  level_ = level;
  step_count_ = 0;
  late_steps_ = 0;
  credit_ = 0;
  return change;
}

std::optional<EffortChange> EffortGovernor::update(const StepTiming& timing) {
  const double wall = atLeastZero(timing.wall);
  remember(wall);
  const std::optional<EffortReason> miss = missAhead(timing);
  const double expected = predicted();
  if (miss) {
    credit_ = 0;
    if (trial_ > 0) backoff_ = std::min(backoff_ * 2, kMostBackoff);
    trial_ = 0;
    if (level_ == lowestLevel()) return std::nullopt;
    const int levels = expected > kFarOver * settings_.step_budget ? 2 : 1;
    return moveTo(std::min(level_ + levels, lowestLevel()), *miss, expected);
  }
  if (trial_ > 0 && --trial_ == 0) backoff_ = std::max(backoff_ / 2, 1);
  if (level_ == 0) return std::nullopt;
  credit(wall, expected);
  const bool ample = step_count_ >= kWindow && kAmple * expected <= kLow * settings_.step_budget;
  const int wait = settings_.good_steps * (ample ? 1 : backoff_);
  if (credit_ < kGoodCredit * wait) return std::nullopt;
  trial_ = wait;
  return moveTo(level_ - 1, EffortReason::kRecovered, expected);
}

}  // namespace swiftlet
