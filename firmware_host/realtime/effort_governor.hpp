#pragma once
// Sets a stage's effort from measured times by rules: lower before a deadline is missed, higher when there is
// room.
//
// Pure: it reads no clock and its state depends only on its inputs, so the same timings give the same
// efforts. There is one governor for each stage that has levels of effort (tracker, smoother). The executor
// gives the stage `effort()`, measures the step, and calls `update`, whose result is an event.
//
// Ladder: efforts from full (level 0) to least. Tracker: fewer features. Smoother: fewer iterations, then
// fewer features, then fewer keyframes, which shortens the window.
// Down by one level (by two if steps take twice their budget) if one of these holds:
// - The predicted step exceeds 0.9 of its budget. The prediction is the second-longest of the last 8 steps
//   at this level: it includes keyframes, about every fourth frame, and ignores one step that the
//   operating system made slow. Right after a step down it is the longest step at this level, however few
//   there are: they confirm the evidence for that step down.
// - Two or more frames wait behind the step, and no fewer than behind the previous one: at once.
// - Three consecutive steps would end later after their frame was ready than allowed. A frame that waits
//   for its IMU samples is not ready, and frames that arrive meanwhile are no backlog: less effort would
//   not bring the samples sooner.
// Up by one level after `good_steps` consecutive steps with a prediction below 0.7 of the budget (steps
// between 0.7 and 0.9 count a quarter), none late and no backlog. If a step up does not hold for as long as
// it was waited for, the next wait doubles, up to eight-fold; if it holds, the wait halves. If even twice the
// time would be below 0.7, the disturbance is over, and the wait is the shortest one.
// So of two changes of direction, one comes at least `good_steps` steps after the other; under a lasting
// overload between two levels, eight times as many.
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
/// Iterations are halved down to 1, then features reduced by a quarter three times (to 40 at least), then
/// keyframes reduced by a quarter down to 5.
EffortLadder smootherLadder(const Effort& full);

struct GovernorSettings {
  double step_budget = 0.020;  ///< s, wall time of a step
  /// s, from the frame being ready to the end of the step: image-to-pose latency less what later stages need.
  double age_budget = 0.050;
  int good_steps = 10;  ///< good steps before a level up; half a second of frames
};

/// Timing of one step. Durations that are negative or NaN count as 0.
struct StepTiming {
  double wall = 0;  ///< s, duration of the step
  int waiting = 0;  ///< frames waiting behind it when it ended
  double age = 0;   ///< s, from the frame being ready to the step's start
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
  double predicted = 0;  ///< s, predicted for the next step at the previous level
};

class EffortGovernor {
 public:
  EffortGovernor(const EffortLadder& ladder, const GovernorSettings& settings);

  /// Effort of the next step.
  [[nodiscard]] const Effort& effort() const { return ladder_[static_cast<std::size_t>(level_)]; }
  [[nodiscard]] int level() const { return level_; }  ///< 0: full effort
  [[nodiscard]] bool degraded() const { return level_ > 0; }
  [[nodiscard]] int lowestLevel() const { return static_cast<int>(ladder_.size()) - 1; }

  /// Takes the timing of the step that ran with effort(). Returns the change of level that it causes, if any.
  std::optional<EffortChange> update(const StepTiming& timing);

  /// s, predicted duration of the next step at this level; 0: unknown.
  [[nodiscard]] double predicted() const;

 private:
  static constexpr std::size_t kWindow = 8;  ///< steps; includes two keyframes if every fourth frame is one

  [[nodiscard]] std::optional<EffortReason> missAhead(const StepTiming& timing);
  void remember(double wall);
  void credit(double wall, double predicted);
  EffortChange moveTo(int level, EffortReason why, double predicted);

  EffortLadder ladder_;
  GovernorSettings settings_;
  int level_ = 0;
  std::array<double, kWindow> steps_{};  ///< s, of the last steps at this level; a ring
  std::size_t step_count_ = 0;
  bool after_drop_ = false;  ///< this level was reached from a higher effort
  int waiting_before_ = 0;
  int late_steps_ = 0;  ///< consecutive
  int credit_ = 0;      ///< quarters of consecutive good steps
  int backoff_ = 1;     ///< factor on good_steps
  int trial_ = 0;       ///< steps that the last step up must still hold for
};

}  // namespace swiftlet
