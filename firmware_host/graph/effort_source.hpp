#pragma once
// Source of a stage's effort: the thread asks what the next step may spend, and reports what it took.

#include "estimator/messages/effort.hpp"
#include "firmware_host/realtime/effort_governor.hpp"

namespace swiftlet {

class EffortSource {
 public:
  EffortSource() = default;
  EffortSource(const EffortSource&) = delete;
  EffortSource& operator=(const EffortSource&) = delete;
  virtual ~EffortSource() = default;

  [[nodiscard]] virtual Effort give() const = 0;
  /// Reports the timing of the step that ran with give()'s effort.
  virtual void took(const StepTiming& timing) = 0;
  /// Levels below full effort.
  [[nodiscard]] virtual int level() const = 0;
};

/// The same effort for every frame: for lockstep, where timing does not matter.
class ConstantEffort : public EffortSource {
 public:
  explicit ConstantEffort(const Effort& effort) : effort_(effort) {}
  [[nodiscard]] Effort give() const override { return effort_; }
  void took(const StepTiming& /*timing*/) override {}
  [[nodiscard]] int level() const override { return 0; }

 private:
  Effort effort_;
};

/// Effort by the governor: lowered before a deadline is missed, raised when there is room
/// (effort_governor.hpp).
class GovernedEffort : public EffortSource {
 public:
  GovernedEffort(const EffortLadder& ladder, const GovernorSettings& settings)
      : governor_(ladder, settings) {}
  [[nodiscard]] Effort give() const override { return governor_.effort(); }
  void took(const StepTiming& timing) override { static_cast<void>(governor_.update(timing)); }
  [[nodiscard]] int level() const override { return governor_.level(); }

 private:
  EffortGovernor governor_;
};

}  // namespace swiftlet
