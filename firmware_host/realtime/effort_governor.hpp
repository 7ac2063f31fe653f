#pragma once
// Turns measured times into effort, by rule: less before a deadline is missed, more when there is room.
//
// Pure: it reads no clock and keeps no state but what it was told; the same timings give the same efforts.
// One governor stands beside each stage that can do with less (tracker, smoother). Its executor gives the
// stage `effort()`, measures the step, and calls `update`; what that returns is an event.
//
// Ladder: efforts from full (level 0) to least. Tracker: fewer features. Smoother: fewer iterations, then
//   fewer features, then fewer keyframes, which shortens the window.
// Down, one level (two when steps take twice their budget), when
//   - the predicted step exceeds 0.9 of its budget. The prediction is the second-longest of the last 8 steps
//     at this level: keyframes, every fourth frame or so, are in it, and one step that the operating
//     system made slow is not. Straight after a step down it is the longest, however few there were: more of
//     the same evidence;
//   - two or more frames wait behind the step and no fewer than behind the one before: at once;
//   - three steps on end would end later after their frame was ready than allowed. A frame that waits for
//     its IMU samples is not ready, and frames that come meanwhile are no backlog: less effort would not
//     bring the samples sooner.
// Up, one level, after `good_steps` steps on end with a prediction below 0.7 of the budget (steps between
//   0.7 and 0.9 count a quarter), none late and nothing piling up. A step up that does not hold for as long
//   as it was waited for doubles the next wait, up to eight-fold; one that holds halves it. When twice the
//   time would still be below 0.7, the disturbance is over and the wait is the short one.
// So of two changes of direction one is at least `good_steps` steps after the other, and under a lasting
// overload between two levels eight times as many.
//
// Memory: a few hundred bytes inside the object. Cost: O(1).

#include <array>
#include <cstddef>
#include <optional>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/messages/effort.hpp"

namespace swiftlet {

/// Efforts from full to least; at least one.
inline constexpr std::size_t kMaxEffortLevels = 16;
using EffortLadder = FixedVector<Effort, kMaxEffortLevels>;

/// Features decrease by a quarter per level, down to 40 (fewer would determine a frame's pose, but not
/// survive the turnover of a fast rotation), or not at all if `full` has fewer.
EffortLadder trackerLadder(const Effort& full);
/// Iterations by halves to 1, then features by a quarter three times (at least 40), then keyframes by
/// a quarter to 5.
EffortLadder smootherLadder(const Effort& full);

struct GovernorSettings {
  double step_budget = 0.020;  ///< s, wall time of a step
  /// s, from when the frame was ready to the end of the step: image-to-pose less what later stages need.
  double age_budget = 0.050;
  int good_steps = 10;  ///< before a level is given back; half a second of frames
};

/// What one step was like. Durations that are negative or no number count as 0.
struct StepTiming {
  double wall = 0;  ///< s, that the step took
  int waiting = 0;  ///< frames waiting behind it when it ended
  double age = 0;   ///< s, from when the frame was ready to the step's start
};

enum class EffortReason {
  kPredictedMiss,  ///< steps take more than their budget
  kBacklog,        ///< frames pile up
  kLate,           ///< frames are finished too long after they were ready
  kRecovered,      ///< there is room again
};

struct EffortChange {
  int from = 0;  ///< level before
  int level = 0;
  Effort effort;  ///< from now on
  EffortReason why = EffortReason::kRecovered;
  double predicted = 0;  ///< s, for the next step at the level before
};

class EffortGovernor {
 public:
  EffortGovernor(const EffortLadder& ladder, const GovernorSettings& settings);

  /// For the next step.
  [[nodiscard]] const Effort& effort() const { return ladder_[static_cast<std::size_t>(level_)]; }
  [[nodiscard]] int level() const { return level_; }  ///< 0: full effort
  [[nodiscard]] bool degraded() const { return level_ > 0; }
  [[nodiscard]] int lowestLevel() const { return static_cast<int>(ladder_.size()) - 1; }

  /// Takes the timing of the step that was given effort(); the change that it causes, if any.
  std::optional<EffortChange> update(const StepTiming& timing);

  /// s, what the next step at this level is expected to take; 0 while nothing is known.
  [[nodiscard]] double predicted() const;

 private:
  static constexpr std::size_t kWindow = 8;  ///< steps; two keyframes at the usual one in four

  [[nodiscard]] std::optional<EffortReason> missAhead(const StepTiming& timing);
  void remember(double wall);
  void credit(double wall, double predicted);
  EffortChange moveTo(int level, EffortReason why, double predicted);

  EffortLadder ladder_;
  GovernorSettings settings_;
  int level_ = 0;
  std::array<double, kWindow> steps_{};  ///< the last ones at this level, a ring
  std::size_t step_count_ = 0;
  bool after_drop_ = false;  ///< this level was reached from above
  int waiting_before_ = 0;
  int late_steps_ = 0;  ///< on end
  int credit_ = 0;      ///< quarters of good steps on end
  int backoff_ = 1;     ///< factor on good_steps
  int trial_ = 0;       ///< steps that the last step up has still to hold for
};

}  // namespace swiftlet
